/* The functions of FMI 2.0 for co-simulation and model exchange. All variables are Real. */
#include <ctype.h>
#include <stdio.h>
#include <string.h>

#include "fmi.h"

#define V(name) fmi2##name
#define V_STATE(before, after) fmi2##before##FMUstate##after
#define DESERIALISE fmi2DeSerializeFMUstate
#include "both.h"

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
    unsigned code = (unsigned char)*address;
    if (code == '%' && isxdigit((unsigned char)address[1]) && isxdigit((unsigned char)address[2]))
      address += sscanf(address + 1, "%2x", &code) * 2;
    *to++ = (char)code;
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

PGRAPH_API status fmi2SetupExperiment(void* of, int, double, double start, int, double) {
  return ((component*)of)->start = start, OK;
}
PGRAPH_API status fmi2EnterInitializationMode(void* of) {
  return ((component*)of)->initialising = 1, OK;
}

PGRAPH_API status fmi2GetReal(void* c, const reference which[], size_t n, double values[]) {
  return get_reals(c, which, n, values);
}
PGRAPH_API status fmi2SetReal(void* c, const reference which[], size_t n, const double values[]) {
  return set_reals(c, which, n, values);
}

#define OTHER_TYPE(name, type)   \
  WITHOUT(fmi2Get##name, type[]) \
  WITHOUT(fmi2Set##name, const type[])
typedef const char* string;
OTHER_TYPE(Integer, int)
OTHER_TYPE(Boolean, int)
OTHER_TYPE(String, string)

PGRAPH_API status fmi2GetDirectionalDerivative(void* c, const reference unknowns[], size_t n,
                                               const reference knowns[], size_t m,
                                               const double seed[], double found[]) {
  return directional(c, unknowns, n, knowns, m, seed, found);
}

PGRAPH_API status fmi2NewDiscreteStates(void* c, event_info* info) {
  memset(info, 0, sizeof *info);
  info->defined = next_event(c, &info->next);
  return put_back(c, &info->values);
}
PGRAPH_API status fmi2CompletedIntegratorStep(void* c, int, int* events, int* terminate) {
  *terminate = 0;
  return completed(c, events);
}
PGRAPH_API status fmi2GetDerivatives(void* c, double rates[], size_t n) {
  return get_rates(c, rates, n);
}

WITHOUT(fmi2SetRealInputDerivatives, const int[], const double[])
WITHOUT(fmi2GetRealOutputDerivatives, const int[], double[])
PGRAPH_API status fmi2DoStep(void* c, double now, double duration, int) {
  double reached;
  return do_step(c, now, duration, &reached);
}
PGRAPH_API status fmi2CancelStep(void* c) { return told(c, ERROR, NEVER); }
#define WITHOUT_STATUS(name, type)                                                     \
  PGRAPH_API status fmi2Get##name##Status(void* c, kind_of_status, type*) {            \
    return told(c, DISCARD, NEVER);                                                     \
  }
WITHOUT_STATUS(, status)
WITHOUT_STATUS(Integer, int)
WITHOUT_STATUS(String, string)
PGRAPH_API status fmi2GetRealStatus(void* c, kind_of_status kind, double* value) {
  if (kind != REACHED) return told(c, DISCARD, NEVER);
  *value = pgraph_time(((component*)c)->p);
  return OK;
}
PGRAPH_API status fmi2GetBooleanStatus(void* c, kind_of_status kind, int* value) {
  if (kind != TERMINATED) return told(c, DISCARD, NEVER);
  *value = ((component*)c)->p->state == -1;
  return OK;
}
