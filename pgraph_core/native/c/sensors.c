/* Readings of the outputs, by the kernels that read them in Python. */
#include <string.h>

#include "image.h"

static void bodies(pgraph* p) {
  arguments a = {.count = 0};
  const int given[] = {A_ROWS,     A_CONST,      A_BODIES_I,     A_BODIES_F, A_FRAME_Q,
                       A_FRAME_V,  A_FRAME_VDOT, A_EXTERNAL,     A_WORK,     A_POSITION,
                       A_ROTATION, A_VELOCITY,   A_ACCELERATION, A_FORCE};
  for (size_t i = 0; i < sizeof given / sizeof *given; i++) put_array(&a, p, given[i]);
  called(w_motion_and_forces, &a);
  arguments b = {.count = 0};
  put_array(&b, p, A_POSITION);
  put_array(&b, p, A_ROTATION);
  put_array(&b, p, A_POSE);
  called(w_as_quaternions, &b);
}

const double* readings(pgraph* p) {
  if (p->seen & 1) return numbers(p, A_READINGS);
  if (p->state == 0) {
    fail(p, "outputs exist after the start");
    return NULL;
  }
  if (accelerate(p)) return NULL;
  mode before = mode_begin();
  memcpy(numbers(p, A_FRAME_Q), numbers(p, A_Q), (size_t)p->words[W_COORDINATES] * 8);
  memcpy(numbers(p, A_FRAME_V), numbers(p, A_V), (size_t)p->words[W_VELOCITIES] * 8);
  memcpy(numbers(p, A_FRAME_VDOT), numbers(p, A_VDOT), (size_t)p->words[W_VELOCITIES] * 8);
  if (p->words[W_MOVES]) bodies(p);
  arguments a = {.count = 0};
  const int given[] = {A_SENSORS,  A_GRAVITY,      A_FRAME_Q, A_FRAME_V, A_POSE,
                       A_VELOCITY, A_ACCELERATION, A_FORCE,   A_READINGS};
  for (size_t i = 0; i < sizeof given / sizeof *given; i++) put_array(&a, p, given[i]);
  called(w_read_sensors, &a);
  mode_end(before);
  p->seen |= 1;
  return numbers(p, A_READINGS);
}
