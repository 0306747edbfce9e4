/* A model of Pgraph without Python: one library for all models, and one file for each model.

   An instance lives in memory that its user provides, and no function allocates. Instances are
   independent, so each thread may step its own. Functions return 0, or -1 with a `pgraph_message`.
   Units are SI units, angles are in radians. */
#ifndef PGRAPH_H
#define PGRAPH_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(_WIN32) && defined(PGRAPH_BUILDS)
#define PGRAPH_API __declspec(dllexport)
#elif defined(PGRAPH_BUILDS)
#define PGRAPH_API __attribute__((visibility("default")))
#else
#define PGRAPH_API
#endif

typedef struct pgraph pgraph;

/* What a variable is. */
enum {
  PGRAPH_TIME,      /* the time, variable 0 */
  PGRAPH_INPUT,     /* may be set at any time */
  PGRAPH_PARAMETER, /* may be set before `pgraph_start` */
  PGRAPH_STATE,     /* a coordinate or velocity; may be set before `pgraph_start` */
  PGRAPH_OUTPUT,    /* may only be read */
  PGRAPH_DERIVATIVE /* time derivative of a state, if the file has these */
};

/* Bytes of memory that an instance of a model needs, or 0 if these `bytes` are no model. If `why`
   is not null, it receives the reason. */
PGRAPH_API size_t pgraph_size(const void* model, size_t bytes, const char** why);

/* An instance in `memory` of that size, aligned to 64 bytes. The model must outlive it. */
PGRAPH_API pgraph* pgraph_create(const void* model, size_t bytes, void* memory);

/* Begin at time t with the parameters, states and inputs that were set. Constraints are met. */
PGRAPH_API int pgraph_start(pgraph* p, double t);
PGRAPH_API double pgraph_first_time(const pgraph* p); /* the start time of the model */

/* Take n steps of the size that the model was written with. Fixed steps only. */
PGRAPH_API int pgraph_step(pgraph* p, int64_t n);

/* Go on by `duration` > 0, in equal steps that are at most as large, or in those that the method
   chooses. A step ends at its end. */
PGRAPH_API int pgraph_advance(pgraph* p, double duration);

PGRAPH_API double pgraph_time(const pgraph* p);
PGRAPH_API const double* pgraph_q(const pgraph* p, size_t* count); /* coordinates */
PGRAPH_API const double* pgraph_v(const pgraph* p, size_t* count); /* velocities */

/* Variables, by number from 0. `pgraph_find` returns -1 if no variable has this name. */
PGRAPH_API int pgraph_count(const pgraph* p);
PGRAPH_API int pgraph_find(const pgraph* p, const char* name);
PGRAPH_API const char* pgraph_name(const pgraph* p, int variable);
PGRAPH_API int pgraph_kind(const pgraph* p, int variable);
PGRAPH_API int pgraph_get(pgraph* p, int variable, double* value);
PGRAPH_API int pgraph_set(pgraph* p, int variable, double value);

/* The complete state. It may be restored into any instance of the same model. */
PGRAPH_API size_t pgraph_state_size(const pgraph* p);
PGRAPH_API void pgraph_save(const pgraph* p, void* state);
PGRAPH_API int pgraph_restore(pgraph* p, const void* state);

/* For other solvers: put the time and the state (coordinates, then velocities), and read its
   derivatives. */
PGRAPH_API int pgraph_put_state(pgraph* p, double t, const double* x);
PGRAPH_API int pgraph_derivatives(pgraph* p, const double** rates);
/* Put the state onto the constraints, and make quaternions unit. `moved` receives the largest
   change. */
PGRAPH_API int pgraph_project(pgraph* p, double* moved);

PGRAPH_API const char* pgraph_message(const pgraph* p);
PGRAPH_API const char* pgraph_kernels(void); /* the version of the kernels */

#ifdef __cplusplus
}
#endif
#endif
