/* Readings of the outputs, by the kernels that read them in Python. */
#include <string.h>

#include "image.h"

static void on_arrays(kernel* k, const pgraph* p, const int* which, int n) {
  arguments a = {.count = 0};
  for (int i = 0; i < n; i++) put_array(&a, p, which[i]);
  called(k, &a);
}

/* The wrenches of forces on bodies, which joints pass on. */
static void loads(pgraph* p) {
  arguments a = {.count = 0};
  const int64_t* size = array_of(p, A_LOADS) + 3;
  memset(numbers(p, A_LOADS), 0, (size_t)(size[0] * size[1]) * 8);
  put_word(&a, (uintptr_t)(p->image + p->words[W_SCENE]));
  put_array(&a, p, A_BODIES_I);
  put_array(&a, p, A_BODIES_F);
  put_real(&a, pgraph_time(p));
  for (int i = 0; i < 3; i++) put_array(&a, p, (const int[]){A_Q, A_V, A_LOADS}[i]);
  called(w_load_wrenches, &a);
  memcpy(numbers(p, A_EXTERNAL), numbers(p, A_LOADS), (size_t)(size[0] * size[1]) * 8);
}

const double* readings(pgraph* p) {
  static const int moved[] = {A_ROWS,     A_CONST,      A_BODIES_I,     A_BODIES_F, A_FRAME_Q,
                              A_FRAME_V,  A_FRAME_VDOT, A_EXTERNAL,     A_WORK,     A_POSITION,
                              A_ROTATION, A_VELOCITY,   A_ACCELERATION, A_FORCE},
                   posed[] = {A_POSITION, A_ROTATION, A_POSE},
                   read[] = {A_SENSORS,  A_GRAVITY,      A_FRAME_Q, A_FRAME_V, A_POSE,
                             A_VELOCITY, A_ACCELERATION, A_FORCE,   A_READINGS};
  if (p->seen & 1) return numbers(p, A_READINGS);
  if (p->state == 0) return fail(p, "outputs exist after the start"), NULL;
  if (accelerate(p)) return NULL;
  memcpy(numbers(p, A_FRAME_Q), numbers(p, A_Q), (size_t)p->words[W_COORDINATES] * 8);
  memcpy(numbers(p, A_FRAME_V), numbers(p, A_V), (size_t)p->words[W_VELOCITIES] * 8);
  memcpy(numbers(p, A_FRAME_VDOT), numbers(p, A_VDOT), (size_t)p->words[W_VELOCITIES] * 8);
  if (p->words[W_LOADED]) loads(p);
  if (p->words[W_MOVES]) {
    on_arrays(w_motion_and_forces, p, moved, sizeof moved / sizeof *moved);
    on_arrays(w_as_quaternions, p, posed, sizeof posed / sizeof *posed);
  }
  on_arrays(w_read_sensors, p, read, sizeof read / sizeof *read);
  p->seen |= 1;
  return numbers(p, A_READINGS);
}
