/* What both versions of FMI share: a component is an instance, its memory and its host. */
#ifndef FMI_H
#define FMI_H

#include <stdlib.h>

#include "image.h"

typedef uint32_t reference;

#define NONE "the model has no variables of this type"
#define NEVER "the FMU does not have this function"

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } status;
/* Give the host a message. */
typedef void teller(void* log, void* environment, const char* name, status how, const char* text);

typedef struct {
  pgraph* p;
  void *model, *memory, *log, *environment;
  size_t bytes; /* of the model */
  char name[128];
  teller* tell;
  double start;
  int initialising; /* between entering and leaving the initialization mode */
} component;

component* component_of(const char* name, const char* token, const char* folder, void* log,
                        void* environment, teller* tell);
void component_free(component* c);
status told(component* c, status how, const char* text);
/* The status of a function of the library that returns 0 or -1. */
status checked(component* c, int code);

status get_reals(component* c, const uint32_t* numbers, size_t n, double* values);
status set_reals(component* c, const uint32_t* numbers, size_t n, const double* values);
status initialise(component* c);
void component_reset(component* c);
status do_step(component* c, double now, double duration, double* reached);

size_t state_count(const component* c);
status put_states(component* c, const double* x, size_t n);
status get_states(component* c, double* x, size_t n);
status get_rates(component* c, double* rates, size_t n);
status set_time(component* c, double t);
status completed(component* c, int* enter_event_mode);
/* Put the states back, in event mode. Whether they changed. */
status put_back(component* c, int* changed);
/* Whether there is a next time event, and its time. */
int next_event(const component* c, double* t);

/* The derivatives of unknowns along a direction of the knowns, from extrapolated differences. */
status directional(component* c, const uint32_t* unknowns, size_t n, const uint32_t* knowns,
                   size_t m, const double* seed, double* found);

/* Copies of the complete state. */
typedef struct {
  size_t bytes;
  double start;
  int64_t model; /* its hash */
  unsigned char memory[];
} copy;
status copy_state(component* c, void** state); /* an earlier copy in *state is freed */
status restored(component* c, const copy* from);
size_t serialised_size(const component* c);
status serialise(component* c, const copy* from, char* to, size_t size);
status deserialise(component* c, const char* from, size_t size, void** state);

/* A function about variables of a type that the model does not have, or about derivatives. */
#define WITHOUT(name, ...)                                                    \
  PGRAPH_API status name(void* c, const reference[], size_t n, __VA_ARGS__) { \
    return n ? told(c, ERROR, NONE) : OK;                                     \
  }

#endif
