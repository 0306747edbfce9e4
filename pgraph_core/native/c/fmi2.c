/* The functions of FMI 2.0 for co-simulation and model exchange. All variables are Real. */
#include <stdlib.h>
#include <string.h>

#include "fmi.h"

typedef void log2_(void* environment, const char* name, status how, const char* category,
                   const char* text, ...);
typedef struct {
  log2_* logger;
  void *allocate, *release, *finished, *environment;
} callbacks;
typedef struct {
  int again, terminate, nominals, values, defined;
  double next;
} event_info;
typedef enum { OF_STEP, PENDING, REACHED, TERMINATED } kind_of_status;

static void tell(void* log, void* environment, const char* name, status how, const char* text) {
  ((log2_*)log)(environment, name, how, how >= ERROR ? "logStatusError" : "logStatusDiscard", "%s",
                text);
}

PGRAPH_API const char* fmi2GetTypesPlatform(void) { return "default"; }
PGRAPH_API const char* fmi2GetVersion(void) { return "2.0"; }
PGRAPH_API status fmi2SetDebugLogging(void*, int, size_t, const char* const[]) { return OK; }

static int digit_of(char x) {
  const char* found = strchr("0123456789abcdef", x | 32);
  return x && found ? (int)(found - "0123456789abcdef") : -1;
}

/* The path in an address such as file:///tmp/a%20b, in new memory. */
static char* path_of(const char* address) {
  if (!strncmp(address, "file:", 5)) {
    address += 5;
    if (!strncmp(address, "//", 2)) address += 2;
    if (!strncmp(address, "localhost/", 10)) address += 9;
#ifdef _WIN32
    if (address[0] == '/') address++;
#endif
  }
  char *found = malloc(strlen(address) + 1), *to = found;
  if (!found) return NULL;
  for (; *address; address++) {
    int high = address[0] == '%' ? digit_of(address[1]) : -1;
    int low = high >= 0 ? digit_of(address[2]) : -1;
    *to++ = low >= 0 ? (char)(16 * high + low) : *address;
    if (low >= 0) address += 2;
  }
  *to = 0;
  return found;
}

PGRAPH_API void* fmi2Instantiate(const char* name, int, const char* guid, const char* folder,
                                 const callbacks* host, int, int) {
  char* path = path_of(folder ? folder : "");
  if (!path) return NULL;
  component* c = component_of(name, guid, path, host ? (void*)host->logger : NULL,
                              host ? host->environment : NULL, tell);
  free(path);
  return c;
}
PGRAPH_API void fmi2FreeInstance(void* c) { component_free(c); }

PGRAPH_API status fmi2SetupExperiment(void* of, int, double, double start, int, double) {
  ((component*)of)->start = start;
  return OK;
}
PGRAPH_API status fmi2EnterInitializationMode(void* of) {
  ((component*)of)->initialising = 1;
  return OK;
}
PGRAPH_API status fmi2ExitInitializationMode(void* of) {
  component* c = of;
  c->initialising = 0;
  return c->p->state == 1 ? OK : initialise(c);
}
PGRAPH_API status fmi2Terminate(void*) { return OK; }
PGRAPH_API status fmi2Reset(void* c) { return component_reset(c), OK; }

PGRAPH_API status fmi2GetReal(void* c, const reference which[], size_t n, double values[]) {
  return get_reals(c, which, n, values);
}
PGRAPH_API status fmi2SetReal(void* c, const reference which[], size_t n, const double values[]) {
  return set_reals(c, which, n, values);
}

/* A function about variables of a type that the model does not have, or about derivatives. */
#define WITHOUT(name, ...)                                                    \
  PGRAPH_API status name(void* c, const reference[], size_t n, __VA_ARGS__) { \
    return n ? told(c, ERROR, NONE) : OK;                                     \
  }
#define OTHER_TYPE(name, type)   \
  WITHOUT(fmi2Get##name, type[]) \
  WITHOUT(fmi2Set##name, const type[])
typedef const char* string;
OTHER_TYPE(Integer, int)
OTHER_TYPE(Boolean, int)
OTHER_TYPE(String, string)

PGRAPH_API status fmi2GetFMUstate(void* c, void** state) { return copy_state(c, state); }
PGRAPH_API status fmi2SetFMUstate(void* c, void* state) { return restored(c, state); }
PGRAPH_API status fmi2FreeFMUstate(void*, void** state) { return free_state(state); }
PGRAPH_API status fmi2SerializedFMUstateSize(void* c, void*, size_t* size) {
  *size = serialised_size(c);
  return OK;
}
PGRAPH_API status fmi2SerializeFMUstate(void* c, void* state, char to[], size_t size) {
  return serialise(c, state, to, size);
}
PGRAPH_API status fmi2DeSerializeFMUstate(void* c, const char from[], size_t size, void** state) {
  return deserialise(c, (const char*)from, size, state);
}
PGRAPH_API status fmi2GetDirectionalDerivative(void* c, const reference[], size_t,
                                               const reference[], size_t, const double[],
                                               double[]) {
  return told(c, ERROR, NEVER);
}

/* -- model exchange --------------------------------------------------------------------------- */

PGRAPH_API status fmi2EnterEventMode(void*) { return OK; }
PGRAPH_API status fmi2EnterContinuousTimeMode(void*) { return OK; }
PGRAPH_API status fmi2NewDiscreteStates(void* c, event_info* info) {
  memset(info, 0, sizeof *info);
  return put_back(c, &info->values);
}
PGRAPH_API status fmi2CompletedIntegratorStep(void* c, int, int* events, int* terminate) {
  *terminate = 0;
  return completed(c, events);
}
PGRAPH_API status fmi2SetTime(void* c, double t) { return set_time(c, t); }
PGRAPH_API status fmi2SetContinuousStates(void* c, const double x[], size_t n) {
  return put_states(c, x, n);
}
PGRAPH_API status fmi2GetContinuousStates(void* c, double x[], size_t n) {
  return get_states(c, x, n);
}
PGRAPH_API status fmi2GetDerivatives(void* c, double rates[], size_t n) {
  return get_rates(c, rates, n);
}
PGRAPH_API status fmi2GetEventIndicators(void* c, double[], size_t n) {
  return n ? told(c, ERROR, NEVER) : OK;
}
PGRAPH_API status fmi2GetNominalsOfContinuousStates(void*, double values[], size_t n) {
  return nominals(values, n);
}

/* -- co-simulation ---------------------------------------------------------------------------- */

WITHOUT(fmi2SetRealInputDerivatives, const int[], const double[])
WITHOUT(fmi2GetRealOutputDerivatives, const int[], double[])
PGRAPH_API status fmi2DoStep(void* c, double now, double duration, int) {
  double reached;
  return do_step(c, now, duration, &reached);
}
PGRAPH_API status fmi2CancelStep(void* c) { return told(c, ERROR, NEVER); }
PGRAPH_API status fmi2GetStatus(void* c, kind_of_status, status*) {
  return told(c, DISCARD, NEVER);
}
PGRAPH_API status fmi2GetRealStatus(void* c, kind_of_status kind, double* value) {
  if (kind != REACHED) return told(c, DISCARD, NEVER);
  *value = pgraph_time(((component*)c)->p);
  return OK;
}
PGRAPH_API status fmi2GetIntegerStatus(void* c, kind_of_status, int*) {
  return told(c, DISCARD, NEVER);
}
PGRAPH_API status fmi2GetBooleanStatus(void* c, kind_of_status kind, int* value) {
  if (kind != TERMINATED) return told(c, DISCARD, NEVER);
  *value = ((component*)c)->p->state == -1;
  return OK;
}
PGRAPH_API status fmi2GetStringStatus(void* c, kind_of_status, const char**) {
  return told(c, DISCARD, NEVER);
}
