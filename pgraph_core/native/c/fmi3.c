/* The functions of FMI 3.0 for co-simulation and model exchange. All variables are Float64. */
#include "fmi.h"

#define V(name) fmi3##name
#define V_STATE(before, after) fmi3##before##FMUState##after
#define DESERIALISE fmi3DeserializeFMUState
#include "both.h"

typedef void log3(void* environment, status how, const char* category, const char* text);

static void tell(void* log, void* environment, const char*, status how, const char* text) {
  ((log3*)log)(environment, how, how >= ERROR ? "logStatusError" : "logStatusDiscard", text);
}

PGRAPH_API const char* fmi3GetVersion(void) { return "3.0"; }
PGRAPH_API status fmi3SetDebugLogging(void*, bool, size_t, const char* const[]) { return OK; }

PGRAPH_API void* fmi3InstantiateModelExchange(const char* name, const char* token,
                                              const char* folder, bool, bool, void* environment,
                                              void* log) {
  return component_of(name, token, folder, log, environment, tell);
}

PGRAPH_API void* fmi3InstantiateCoSimulation(const char* name, const char* token,
                                             const char* folder, bool, bool, bool, bool,
                                             const reference[], size_t, void* environment,
                                             void* log, void*) {
  return component_of(name, token, folder, log, environment, tell);
}

PGRAPH_API void* fmi3InstantiateScheduledExecution(const char*, const char*, const char*, bool,
                                                   bool, void* environment, void* log, void*, void*,
                                                   void*) {
  if (log) tell(log, environment, "", ERROR, "the FMU has no scheduled execution");
  return NULL;
}

PGRAPH_API status fmi3EnterInitializationMode(void* of, bool, double, double start, bool, double) {
  component* c = of;
  c->start = start;
  c->initialising = 1;
  return OK;
}

PGRAPH_API status fmi3EnterStepMode(void*) { return OK; }
PGRAPH_API status fmi3EnterConfigurationMode(void* c) { return told(c, ERROR, NEVER); }
PGRAPH_API status fmi3ExitConfigurationMode(void* c) { return told(c, ERROR, NEVER); }

PGRAPH_API status fmi3GetFloat64(void* of, const reference which[], size_t n, double values[],
                                 size_t count) {
  return n == count ? get_reals(of, which, n, values) : told(of, ERROR, "the counts differ");
}

PGRAPH_API status fmi3SetFloat64(void* of, const reference which[], size_t n, const double values[],
                                 size_t count) {
  return n == count ? set_reals(of, which, n, values) : told(of, ERROR, "the counts differ");
}

#define OTHER_TYPE(name, type)           \
  WITHOUT(fmi3Get##name, type[], size_t) \
  WITHOUT(fmi3Set##name, const type[], size_t)
OTHER_TYPE(Float32, float) OTHER_TYPE(Int8, int8_t) OTHER_TYPE(UInt8, uint8_t)
OTHER_TYPE(Int16, int16_t) OTHER_TYPE(UInt16, uint16_t) OTHER_TYPE(Int32, int32_t)
OTHER_TYPE(UInt32, uint32_t) OTHER_TYPE(Int64, int64_t) OTHER_TYPE(UInt64, uint64_t)
OTHER_TYPE(Boolean, bool)
WITHOUT(fmi3GetString, const char*[], size_t) WITHOUT(fmi3SetString, const char* const[], size_t)
WITHOUT(fmi3GetBinary, size_t[], const uint8_t*[], size_t)
WITHOUT(fmi3SetBinary, const size_t[], const uint8_t* const[], size_t)
WITHOUT(fmi3GetClock, bool[]) WITHOUT(fmi3SetClock, const bool[])
WITHOUT(fmi3GetIntervalDecimal, double[], int[])
WITHOUT(fmi3GetIntervalFraction, uint64_t[], uint64_t[], int[])
WITHOUT(fmi3GetShiftDecimal, double[]) WITHOUT(fmi3GetShiftFraction, uint64_t[], uint64_t[])
WITHOUT(fmi3SetIntervalDecimal, const double[])
WITHOUT(fmi3SetIntervalFraction, const uint64_t[], const uint64_t[])
WITHOUT(fmi3SetShiftDecimal, const double[])
WITHOUT(fmi3SetShiftFraction, const uint64_t[], const uint64_t[])
WITHOUT(fmi3GetOutputDerivatives, const int32_t[], double[], size_t)

PGRAPH_API status fmi3GetNumberOfVariableDependencies(void* c, reference, size_t*) {
  return told(c, ERROR, NEVER);
}
PGRAPH_API status fmi3GetVariableDependencies(void* c, reference, size_t[], reference[], size_t[],
                                              int[], size_t) {
  return told(c, ERROR, NEVER);
}

PGRAPH_API status fmi3GetDirectionalDerivative(void* c, const reference unknowns[], size_t n,
                                               const reference knowns[], size_t m,
                                               const double seed[], size_t seeds, double found[],
                                               size_t count) {
  if (seeds != m || count != n) return told(c, ERROR, "the counts differ");
  return directional(c, unknowns, n, knowns, m, seed, found);
}
PGRAPH_API status fmi3GetAdjointDerivative(void* c, const reference[], size_t, const reference[],
                                           size_t, const double[], size_t, double[], size_t) {
  return told(c, ERROR, NEVER);
}

PGRAPH_API status fmi3EvaluateDiscreteStates(void*) { return OK; }
PGRAPH_API status fmi3UpdateDiscreteStates(void* c, bool* again, bool* terminate, bool* scales,
                                           bool* values, bool* defined, double* next) {
  int changed = 0;
  status how = put_back(c, &changed);
  *again = *terminate = *scales = false;
  *values = changed;
  *defined = next_event(c, next);
  return how;
}

PGRAPH_API status fmi3CompletedIntegratorStep(void* c, bool, bool* events, bool* terminate) {
  int enter = 0;
  status how = completed(c, &enter);
  *events = enter;
  *terminate = false;
  return how;
}
PGRAPH_API status fmi3GetContinuousStateDerivatives(void* c, double rates[], size_t n) {
  return get_rates(c, rates, n);
}
PGRAPH_API status fmi3GetNumberOfEventIndicators(void*, size_t* n) { return *n = 0, OK; }
PGRAPH_API status fmi3GetNumberOfContinuousStates(void* c, size_t* n) {
  return *n = state_count(c), OK;
}

PGRAPH_API status fmi3DoStep(void* c, double now, double duration, bool, bool* events,
                             bool* terminate, bool* early, double* reached) {
  *events = *terminate = *early = false;
  return do_step(c, now, duration, reached);
}
PGRAPH_API status fmi3ActivateModelPartition(void* c, reference, double) {
  return told(c, ERROR, NEVER);
}
