/* The functions of FMI 3.0 for co-simulation and model exchange. All variables are Float64. */
#include "fmi.h"

#include <stdbool.h>
#include <stdlib.h>

typedef uint32_t reference;
typedef void log3(void *environment, status how, const char *category, const char *text);

static void tell(void *log, void *environment, const char *name, status how, const char *text) {
  (void)name;
  ((log3 *)log)(environment, how, how >= ERROR ? "logStatusError" : "logStatusDiscard", text);
}

static status unknown(void *c, const char *what) { return told(c, ERROR, what); }
static const char NONE[] = "the model has no variables of this type";
static const char NEVER[] = "the FMU does not have this function";

PGRAPH_API const char *fmi3GetVersion(void) { return "3.0"; }
PGRAPH_API status fmi3SetDebugLogging(void *c, bool on, size_t n, const char *const names[]) {
  (void)c, (void)on, (void)n, (void)names;
  return OK;
}

PGRAPH_API void *fmi3InstantiateModelExchange(const char *name, const char *token,
                                              const char *folder, bool visible, bool logging,
                                              void *environment, void *log) {
  (void)visible, (void)logging;
  return component_of(name, token, folder, log, environment, tell);
}

PGRAPH_API void *fmi3InstantiateCoSimulation(const char *name, const char *token,
                                             const char *folder, bool visible, bool logging,
                                             bool events, bool early, const reference needed[],
                                             size_t n, void *environment, void *log, void *update) {
  (void)visible, (void)logging, (void)events, (void)early, (void)needed, (void)n, (void)update;
  return component_of(name, token, folder, log, environment, tell);
}

PGRAPH_API void *fmi3InstantiateScheduledExecution(const char *name, const char *token,
                                                   const char *folder, bool visible, bool logging,
                                                   void *environment, void *log, void *update,
                                                   void *lock, void *unlock) {
  (void)name, (void)token, (void)folder, (void)visible, (void)logging, (void)update, (void)lock;
  (void)unlock;
  if (log) tell(log, environment, "", ERROR, "the FMU has no scheduled execution");
  return NULL;
}

PGRAPH_API void fmi3FreeInstance(void *c) { component_free(c); }

PGRAPH_API status fmi3EnterInitializationMode(void *of, bool tolerance_defined, double tolerance,
                                              double start, bool stop_defined, double stop) {
  (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
  component *c = of;
  c->start = start;
  c->initialising = 1;
  return OK;
}

PGRAPH_API status fmi3ExitInitializationMode(void *of) {
  component *c = of;
  c->initialising = 0;
  return c->p->state == 1 ? OK : initialise(c);
}

PGRAPH_API status fmi3EnterEventMode(void *c) { return (void)c, OK; }
PGRAPH_API status fmi3EnterContinuousTimeMode(void *c) { return (void)c, OK; }
PGRAPH_API status fmi3EnterStepMode(void *c) { return (void)c, OK; }
PGRAPH_API status fmi3EnterConfigurationMode(void *c) { return unknown(c, NEVER); }
PGRAPH_API status fmi3ExitConfigurationMode(void *c) { return unknown(c, NEVER); }
PGRAPH_API status fmi3Terminate(void *c) { return (void)c, OK; }
PGRAPH_API status fmi3Reset(void *c) { return component_reset(c), OK; }

PGRAPH_API status fmi3GetFloat64(void *of, const reference which[], size_t n, double values[],
                                 size_t count) {
  return n == count ? get_reals(of, which, n, values) : unknown(of, "the counts differ");
}

PGRAPH_API status fmi3SetFloat64(void *of, const reference which[], size_t n,
                                 const double values[], size_t count) {
  return n == count ? set_reals(of, which, n, values) : unknown(of, "the counts differ");
}

#define OTHER_TYPE(name, type)                                                                   \
  PGRAPH_API status fmi3Get##name(void *c, const reference which[], size_t n, type values[],     \
                                  size_t count) {                                                \
    return (void)which, (void)values, (void)count, n ? unknown(c, NONE) : OK;                    \
  }                                                                                              \
  PGRAPH_API status fmi3Set##name(void *c, const reference which[], size_t n,                    \
                                  const type values[], size_t count) {                           \
    return (void)which, (void)values, (void)count, n ? unknown(c, NONE) : OK;                    \
  }
OTHER_TYPE(Float32, float)
OTHER_TYPE(Int8, int8_t)
OTHER_TYPE(UInt8, uint8_t)
OTHER_TYPE(Int16, int16_t)
OTHER_TYPE(UInt16, uint16_t)
OTHER_TYPE(Int32, int32_t)
OTHER_TYPE(UInt32, uint32_t)
OTHER_TYPE(Int64, int64_t)
OTHER_TYPE(UInt64, uint64_t)
OTHER_TYPE(Boolean, bool)

PGRAPH_API status fmi3GetString(void *c, const reference which[], size_t n, const char *values[],
                                size_t count) {
  return (void)which, (void)values, (void)count, n ? unknown(c, NONE) : OK;
}
PGRAPH_API status fmi3SetString(void *c, const reference which[], size_t n,
                                const char *const values[], size_t count) {
  return (void)which, (void)values, (void)count, n ? unknown(c, NONE) : OK;
}
PGRAPH_API status fmi3GetBinary(void *c, const reference which[], size_t n, size_t sizes[],
                                const uint8_t *values[], size_t count) {
  return (void)which, (void)sizes, (void)values, (void)count, n ? unknown(c, NONE) : OK;
}
PGRAPH_API status fmi3SetBinary(void *c, const reference which[], size_t n, const size_t sizes[],
                                const uint8_t *const values[], size_t count) {
  return (void)which, (void)sizes, (void)values, (void)count, n ? unknown(c, NONE) : OK;
}
PGRAPH_API status fmi3GetClock(void *c, const reference which[], size_t n, bool values[]) {
  return (void)which, (void)values, n ? unknown(c, NONE) : OK;
}
PGRAPH_API status fmi3SetClock(void *c, const reference which[], size_t n, const bool values[]) {
  return (void)which, (void)values, n ? unknown(c, NONE) : OK;
}

PGRAPH_API status fmi3GetNumberOfVariableDependencies(void *c, reference which, size_t *n) {
  return (void)which, (void)n, unknown(c, NEVER);
}
PGRAPH_API status fmi3GetVariableDependencies(void *c, reference which, size_t elements[],
                                              reference others[], size_t theirs[], int kinds[],
                                              size_t n) {
  (void)which, (void)elements, (void)others, (void)theirs, (void)kinds, (void)n;
  return unknown(c, NEVER);
}

PGRAPH_API status fmi3GetFMUState(void *of, void **state) {
  component *c = of;
  if (*state) { /* an earlier copy is used again */
    free(*state);
  }
  *state = copied(c);
  return *state ? OK : told(c, ERROR, "there is no memory");
}
PGRAPH_API status fmi3SetFMUState(void *c, void *state) { return restored(c, state); }
PGRAPH_API status fmi3FreeFMUState(void *c, void **state) {
  (void)c;
  if (state) {
    free(*state);
    *state = NULL;
  }
  return OK;
}
PGRAPH_API status fmi3SerializedFMUStateSize(void *c, void *state, size_t *size) {
  (void)state;
  *size = serialised_size(c);
  return OK;
}
PGRAPH_API status fmi3SerializeFMUState(void *c, void *state, uint8_t to[], size_t size) {
  return serialise(c, state, (char *)to, size);
}
PGRAPH_API status fmi3DeserializeFMUState(void *c, const uint8_t from[], size_t size,
                                          void **state) {
  *state = deserialised(c, (const char *)from, size);
  return *state ? OK : ERROR;
}

#define DERIVATIVE(name)                                                                         \
  PGRAPH_API status name(void *c, const reference unknowns[], size_t n, const reference knowns[],\
                         size_t m, const double seed[], size_t seeds, double found[],            \
                         size_t count) {                                                         \
    (void)unknowns, (void)n, (void)knowns, (void)m, (void)seed, (void)seeds, (void)found;        \
    return (void)count, unknown(c, NEVER);                                                       \
  }
DERIVATIVE(fmi3GetDirectionalDerivative)
DERIVATIVE(fmi3GetAdjointDerivative)

#define CLOCKS(name, ...)                                                                        \
  PGRAPH_API status name(void *c, const reference which[], size_t n, __VA_ARGS__) {              \
    return (void)which, (void)a, (void)b, n ? unknown(c, NONE) : OK;                             \
  }
CLOCKS(fmi3GetIntervalDecimal, double a[], int b[])
CLOCKS(fmi3GetShiftFraction, uint64_t a[], uint64_t b[])
CLOCKS(fmi3SetIntervalFraction, const uint64_t a[], const uint64_t b[])
CLOCKS(fmi3SetShiftFraction, const uint64_t a[], const uint64_t b[])
PGRAPH_API status fmi3GetIntervalFraction(void *c, const reference which[], size_t n, uint64_t a[],
                                          uint64_t b[], int kinds[]) {
  return (void)which, (void)a, (void)b, (void)kinds, n ? unknown(c, NONE) : OK;
}
PGRAPH_API status fmi3GetShiftDecimal(void *c, const reference which[], size_t n, double a[]) {
  return (void)which, (void)a, n ? unknown(c, NONE) : OK;
}
PGRAPH_API status fmi3SetIntervalDecimal(void *c, const reference which[], size_t n,
                                         const double a[]) {
  return (void)which, (void)a, n ? unknown(c, NONE) : OK;
}
PGRAPH_API status fmi3SetShiftDecimal(void *c, const reference which[], size_t n,
                                      const double a[]) {
  return (void)which, (void)a, n ? unknown(c, NONE) : OK;
}

PGRAPH_API status fmi3EvaluateDiscreteStates(void *c) { return (void)c, OK; }
PGRAPH_API status fmi3UpdateDiscreteStates(void *of, bool *again, bool *terminate, bool *nominals,
                                           bool *values, bool *defined, double *next) {
  component *c = of;
  double moved = 0.0;
  *again = *terminate = *nominals = *defined = false;
  *next = 0.0;
  status how = c->p->state == 1 ? checked(c, pgraph_project(c->p, &moved)) : OK;
  *values = moved > 0.0;
  return how;
}

/* -- model exchange --------------------------------------------------------------------------- */

PGRAPH_API status fmi3CompletedIntegratorStep(void *c, bool final, bool *events, bool *terminate) {
  int enter = 0;
  (void)final;
  status how = completed(c, &enter);
  *events = enter;
  *terminate = false;
  return how;
}
PGRAPH_API status fmi3SetTime(void *c, double t) { return set_time(c, t); }
PGRAPH_API status fmi3SetContinuousStates(void *c, const double x[], size_t n) {
  return put_states(c, x, n);
}
PGRAPH_API status fmi3GetContinuousStates(void *c, double x[], size_t n) {
  return get_states(c, x, n);
}
PGRAPH_API status fmi3GetContinuousStateDerivatives(void *c, double rates[], size_t n) {
  return get_rates(c, rates, n);
}
PGRAPH_API status fmi3GetEventIndicators(void *c, double values[], size_t n) {
  return (void)values, n ? unknown(c, NEVER) : OK;
}
PGRAPH_API status fmi3GetNominalsOfContinuousStates(void *c, double nominals[], size_t n) {
  (void)c;
  for (size_t i = 0; i < n; i++) nominals[i] = 1.0;
  return OK;
}
PGRAPH_API status fmi3GetNumberOfEventIndicators(void *c, size_t *n) {
  *n = 0;
  return (void)c, OK;
}
PGRAPH_API status fmi3GetNumberOfContinuousStates(void *c, size_t *n) {
  *n = state_count(c);
  return OK;
}

/* -- co-simulation ---------------------------------------------------------------------------- */

PGRAPH_API status fmi3GetOutputDerivatives(void *c, const reference which[], size_t n,
                                           const int32_t orders[], double values[], size_t count) {
  return (void)which, (void)orders, (void)values, (void)count, n ? unknown(c, NEVER) : OK;
}
PGRAPH_API status fmi3DoStep(void *c, double now, double duration, bool final, bool *events,
                             bool *terminate, bool *early, double *reached) {
  (void)final;
  *events = *terminate = *early = false;
  return do_step(c, now, duration, reached);
}
PGRAPH_API status fmi3ActivateModelPartition(void *c, reference clock, double t) {
  return (void)clock, (void)t, unknown(c, NEVER);
}
