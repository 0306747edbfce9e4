/* Step an instance, as `engine.js` does in the browser: kernels are called in turn. */
#include <math.h>
#include <string.h>

#include "image.h"

enum { DONE = 0, RUNNING = 3 };  /* status codes of a run that has not failed */
static const double SAME = 1e-9; /* as in simulation/options.py */
static const int64_t ROUNDS = 50;
static const double ROUNDED = 1e-12; /* of the square of a quaternion from 1 */
static const double NOTABLE = 1e-6;  /* as in analysis/assembly.py */

extern void k_acceleration(void);

/* Why a run stopped, by the status code of the kernels. */
static const char* const reasons[] = {
    "", "the numbers are no longer finite: try a smaller step",
    "the constraints can no longer be met: the mechanism may be torn or singular", "",
    "the error allows no step: something changes too fast", "it took too many steps",
    "the equations of a step could not be solved: try a smaller step"};

size_t pgraph_size(const void* model, size_t bytes, const char** why) {
  const char* problem = image_problem(model, bytes);
  if (why) *why = problem;
  if (problem) return 0;
  return (sizeof(pgraph) / ALIGNMENT + 1) * ALIGNMENT +
         (size_t)((const int64_t*)model)[W_IMAGE_BYTES];
}

pgraph* pgraph_create(const void* model, size_t bytes, void* memory) {
  if (image_problem(model, bytes) || !memory || (uintptr_t)memory % ALIGNMENT) return NULL;
  pgraph* p = memory;
  memset(p, 0, sizeof *p);
  p->words = model;
  p->image = (unsigned char*)memory + (sizeof(pgraph) / ALIGNMENT + 1) * ALIGNMENT;
  memcpy(p->image, (const unsigned char*)model + p->words[W_IMAGE],
         (size_t)p->words[W_IMAGE_BYTES]);
  p->values = real_at(p, W_VALUES);
  image_load(p);
  return p;
}

double pgraph_time(const pgraph* p) { return *real_at(p, W_TIME); }
double pgraph_first_time(const pgraph* p) { return real_word(p, W_START); }

const double* pgraph_q(const pgraph* p, size_t* count) {
  if (count) *count = (size_t)p->words[W_COORDINATES];
  return numbers(p, A_Q);
}

const double* pgraph_v(const pgraph* p, size_t* count) {
  if (count) *count = (size_t)p->words[W_VELOCITIES];
  return numbers(p, A_V);
}

/* -- variables -------------------------------------------------------------------------------- */

static int ready(pgraph* p) {
  if (p->state == 1) return 0;
  return p->state ? fail(p, "the run has stopped at t = %.6g s; start it again", pgraph_time(p))
                  : fail(p, "the instance has not been started");
}

static const int64_t* variable(const pgraph* p, int k) {
  return section(p, W_VARIABLES) + (int64_t)k * V_WORDS;
}

int pgraph_count(const pgraph* p) { return (int)p->words[W_VARIABLE_COUNT]; }
const char* pgraph_name(const pgraph* p, int k) {
  if (k < 0 || k >= pgraph_count(p)) return "";
  return (const char*)p->words + variable(p, k)[V_NAME];
}

int pgraph_kind(const pgraph* p, int k) {
  return k < 0 || k >= pgraph_count(p) ? -1 : (int)variable(p, k)[V_KIND];
}

int pgraph_find(const pgraph* p, const char* name) {
  for (int k = 0; k < pgraph_count(p); k++)
    if (!strcmp(pgraph_name(p, k), name)) return k;
  return -1;
}

/* Let a value act. Whether the table of bodies has to be packed again. */
static int act(pgraph* p, int k, double value) {
  const int64_t *one = variable(p, k), *effect = section(p, W_EFFECTS);
  int packs = 0;
  effect += one[V_FIRST_EFFECT] * E_WORDS;
  for (int64_t i = 0; i < one[V_EFFECTS]; i++, effect += E_WORDS) {
    double* at = (double*)(p->image + effect[E_PLACE]);
    double start = real(effect + E_START), slope = real(effect + E_SLOPE);
    if (effect[E_LAG] && p->state == 1) { /* (time, value, slope, effective value) of a knot */
      double lag = real(effect + E_LAG), *knot = at - 1, past = pgraph_time(p) - knot[0];
      arguments a = {.count = 0};
      put_real(&a, knot[3]);
      put_real(&a, knot[1]);
      put_real(&a, 0.0);
      put_real(&a, (past > 0.0 ? past : 0.0) / lag);
      int64_t bits = called(w_followed, &a);
      memcpy(knot + 3, &bits, 8);
      knot[0] = pgraph_time(p);
    }
    double found = start == 0.0 ? slope * value : start + slope * value;
    *at = fmin(fmax(found, real(effect + E_LOW)), real(effect + E_HIGH));
    packs |= (int)effect[E_PACKS];
  }
  return packs;
}

int pgraph_set(pgraph* p, int k, double value) {
  int kind = pgraph_kind(p, k);
  if (kind < 0) return fail(p, "no variable has the number %d; there are %d", k, pgraph_count(p));
  if (kind == PGRAPH_TIME || kind == PGRAPH_OUTPUT || kind == PGRAPH_DERIVATIVE)
    return fail(p, "'%s' is computed, so it cannot be set", pgraph_name(p, k));
  if (!isfinite(value))
    return fail(p, "'%s' must be a finite number, given %g", pgraph_name(p, k), value);
  double low = real(variable(p, k) + V_LOW), high = real(variable(p, k) + V_HIGH);
  if (!(value >= low && value <= high))
    return fail(p, "'%s' must be from %g to %g, given %g", pgraph_name(p, k), low, high, value);
  if (kind != PGRAPH_INPUT && p->state != 0)
    return fail(p, "'%s' can only be set before the start", pgraph_name(p, k));
  if (kind == PGRAPH_INPUT && p->state == 1 && p->values[k] != value) {
    act(p, k, value);
    *integer_at(p, W_FRESH) = 0;
  }
  p->values[k] = value;
  p->seen = 0;
  return 0;
}

int move(pgraph* p, int k, double by) {
  int kind = pgraph_kind(p, k);
  if (kind == PGRAPH_TIME) {
    *real_at(p, W_TIME) += by;
  } else if (kind == PGRAPH_STATE) {
    *(double*)(p->image + variable(p, k)[V_READ]) += by;
  } else if (kind == PGRAPH_INPUT) {
    act(p, k, p->values[k] += by);
  } else {
    return fail(p, "'%s' is no state, input or time, by which derivatives exist",
                pgraph_name(p, k));
  }
  *integer_at(p, W_FRESH) = 0;
  p->seen = 0;
  return 0;
}

int pgraph_get(pgraph* p, int k, double* value) {
  int kind = pgraph_kind(p, k);
  if (kind < 0) return fail(p, "no variable has the number %d; there are %d", k, pgraph_count(p));
  if (kind == PGRAPH_TIME) {
    *value = pgraph_time(p);
  } else if (kind == PGRAPH_OUTPUT) {
    const double* found = readings(p);
    if (!found) return -1;
    *value = found[variable(p, k)[V_READ]];
  } else if (kind == PGRAPH_DERIVATIVE) {
    const double* found;
    if (pgraph_derivatives(p, &found)) return -1;
    *value = found[variable(p, k)[V_READ]];
  } else if (kind == PGRAPH_STATE && p->state != 0) {
    *value = *(double*)(p->image + variable(p, k)[V_READ]);
  } else {
    *value = p->values[k];
  }
  return 0;
}

/* -- the start -------------------------------------------------------------------------------- */

static double length(const double* x) { return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]); }

/* Largest of the mechanism's own lengths [m], as `length_in` in packing. */
static double length_of(const pgraph* p) {
  const int64_t *w = p->words, rows = w[W_ROWS], columns = array_of(p, A_CONST)[4];
  double gyration = 0.0, far = 0.0;
  for (int64_t r = 1; r < rows; r++) {
    const double *row = numbers(p, A_CONST) + r * columns, *inertia = row + w[W_INERTIA];
    double mass = row[w[W_MASS]];
    if (mass > 0.0) gyration = fmax(gyration, (inertia[0] + inertia[1] + inertia[2]) / mass);
    far = fmax(far, fmax(length(row + w[W_LINK]), length(row + w[W_COM])));
  }
  double found = fmax(sqrt(gyration), far);
  if (found > 0.0) return found;
  for (int64_t i = 0; i < w[W_COORDINATES]; i++) found = fmax(found, fabs(numbers(p, A_HOME)[i]));
  return found > 0.0 ? found : 1.0;
}

/* The constants of the kernels from the table of bodies. */
static void pack(const pgraph* p) {
  arguments a = {.count = 0};
  for (int i = A_PARENT; i <= A_HOME; i++) put_array(&a, p, i);
  called(w_pack, &a);
  const int64_t *place = section(p, W_LENGTHS), *copy = section(p, W_COPIES);
  for (int64_t i = 0; i < p->words[W_LENGTH_COUNT]; i++)
    *(double*)(p->image + place[i]) = length_of(p);
  for (int64_t i = 0; i < p->words[W_COPY_COUNT]; i++, copy += 3)
    memmove(p->image + copy[1], p->image + copy[0], (size_t)copy[2]);
}

static uint64_t scene(const pgraph* p) { return (uintptr_t)(p->image + p->words[W_SCENE]); }
static uint64_t run(const pgraph* p) { return (uintptr_t)(p->image + p->words[W_RUN]); }

int drift(pgraph* p, double* moved) {
  int64_t nq = array_of(p, A_Q)[3], nv = array_of(p, A_V)[3], count[2] = {nq, nv};
  double *trial = numbers(p, A_TRIAL), *q = numbers(p, A_Q), *v = numbers(p, A_V);
  const int64_t* spin = section(p, W_SPINS);
  memcpy(trial, q, (size_t)nq * 8);
  memcpy(trial + nq, v, (size_t)nv * 8);
  for (int64_t i = 0; i < p->words[W_SPIN_COUNT]; i++, spin += 2) {
    double *x = trial + spin[0], size = x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3];
    if (fabs(size - 1.0) > ROUNDED)
      for (int k = 0; k < 4; k++) x[k] /= sqrt(size);
  }
  arguments a = {.count = 0};
  put_word(&a, scene(p));
  put_real(&a, pgraph_time(p));
  for (int i = 0; i < 2; i++) {
    const uint64_t one[7] = {
        0, 0, (uint64_t)count[i], 8, (uintptr_t)(trial + (i ? nq : 0)), (uint64_t)count[i], 8};
    for (int k = 0; k < 7; k++) put_word(&a, one[k]);
  }
  put_word(&a, (uint64_t)ROUNDS);
  int64_t rounds = p->words[W_PROJECT] ? called(w_projection, &a) : 0;
  double most = 0.0;
  for (int64_t i = 0; i < nq + nv; i++) {
    double change = fabs(trial[i] - (i < nq ? q[i] : v[i - nq]));
    most = change > most || change != change ? change : most;
  }
  if (rounds < 0 || !isfinite(most)) return fail(p, "the constraints cannot be met");
  *moved = most;
  return 0;
}

int pgraph_project(pgraph* p, double* moved) {
  size_t nq = (size_t)array_of(p, A_Q)[3], nv = (size_t)array_of(p, A_V)[3];
  double change = 0.0;
  int code = drift(p, &change);
  if (moved) *moved = change;
  if (code) return -1;
  memcpy(numbers(p, A_Q), numbers(p, A_TRIAL), nq * 8);
  memcpy(numbers(p, A_V), numbers(p, A_TRIAL) + nq, nv * 8);
  p->seen = 0;
  return 0;
}

int accelerate(pgraph* p) {
  arguments a = {.count = 0};
  put_word(&a, scene(p));
  put_word(&a, (uintptr_t)k_acceleration);
  put_real(&a, pgraph_time(p));
  for (int i = 0; i < 6; i++) {
    const int which[] = {A_Q, A_V, A_GIVEN, A_FLOW, A_VDOT, A_WRENCHES};
    put_array(&a, p, which[i]);
  }
  int64_t code = called(w_constrained_dynamics, &a);
  if (code > 0) return fail(p, "a joint has no inertia with these values");
  return code < 0 ? fail(p, "the acceleration is not finite at t = %g s", pgraph_time(p)) : 0;
}

int pgraph_put_state(pgraph* p, double t, const double* x) {
  if (ready(p)) return -1;
  size_t nq = (size_t)p->words[W_COORDINATES], nv = (size_t)p->words[W_VELOCITIES];
  *real_at(p, W_TIME) = t;
  memcpy(numbers(p, A_Q), x, nq * 8);
  memcpy(numbers(p, A_V), x + nq, nv * 8);
  *integer_at(p, W_FRESH) = 0;
  p->seen = 0;
  return 0;
}

int pgraph_derivatives(pgraph* p, const double** rates) {
  if (ready(p)) return -1;
  double *x = numbers(p, A_X), *q = numbers(p, A_Q), *v = numbers(p, A_V);
  *rates = x;
  if (p->seen & 2) return 0;
  if (accelerate(p)) return -1;
  const int64_t *slide = section(p, W_SLIDES), *spin = section(p, W_SPINS);
  for (int64_t i = 0; i < p->words[W_SLIDE_COUNT]; i++, slide += 2) x[slide[0]] = v[slide[1]];
  for (int64_t i = 0; i < p->words[W_SPIN_COUNT]; i++, spin += 2) {
    const double *a = q + spin[0], *w = v + spin[1]; /* p' = (0, w) p / 2 */
    double* to = x + spin[0];
    to[0] = -0.5 * (w[0] * a[1] + w[1] * a[2] + w[2] * a[3]);
    to[1] = 0.5 * (w[0] * a[0] + w[1] * a[3] - w[2] * a[2]);
    to[2] = 0.5 * (w[1] * a[0] + w[2] * a[1] - w[0] * a[3]);
    to[3] = 0.5 * (w[2] * a[0] + w[0] * a[2] - w[1] * a[1]);
  }
  memcpy(x + p->words[W_COORDINATES], numbers(p, A_VDOT), (size_t)p->words[W_VELOCITIES] * 8);
  p->seen |= 2;
  return 0;
}

static void choose_steps(pgraph* p) {
  if (p->words[W_ADAPTIVE]) {
    *integer_at(p, W_WIDTHS) = p->words[p->words[W_BY_TOLERANCE] ? W_CHOSEN : W_GIVEN];
    *real_at(p, W_RTOL) = real_word(p, p->words[W_BY_TOLERANCE] ? W_TOLERANCE : W_FIXED_TOLERANCE);
  }
  if (!p->words[W_BY_TOLERANCE]) return;
  double most = real_word(p, W_STEP), span = real_word(p, W_USUAL_SPAN);
  *real_at(p, W_WIDEST) = most > 0.0 ? most : span;
  *real_at(p, W_SPAN) = span;
}

int pgraph_start(pgraph* p, double t) {
  int packs = 0;
  if (t != real_word(p, W_START) && !p->words[W_MOVABLE])
    return fail(p,
                "this model starts at t = %g s, since it has lags or samples that begin there; "
                "given %g s",
                real_word(p, W_START), t);
  if (!isfinite(t)) return fail(p, "the start time must be finite, given %g", t);
  image_load(p);
  p->state = 0;
  p->message[0] = 0;
  const double* own =
      (const double*)((const char*)p->words + p->words[W_IMAGE] + p->words[W_VALUES]);
  for (int k = 0; k < pgraph_count(p); k++) /* what was not changed keeps its bits */
    if (p->values[k] != own[k]) packs |= act(p, k, p->values[k]);
  if (packs) pack(p);
  *real_at(p, W_TIME) = *real_at(p, W_ORIGIN) = numbers(p, A_TIMES)[0] = p->began = t;
  double moved = 0.0;
  if (pgraph_project(p, &moved) || !(moved <= NOTABLE))
    return fail(p, "the constraints are not met at the start with these values");
  if (accelerate(p)) return -1;
  if (p->words[W_BOUNDED]) {
    arguments a = {.count = 0};
    put_word(&a, run(p));
    put_word(&a, (uint64_t)p->words[W_STATE_ROW]);
      called(w_bound_step, &a);
  }
  choose_steps(p);
  if (!p->words[W_BY_TOLERANCE]) *real_at(p, W_WIDEST) = 0.0;
  p->state = 1;
  p->seen = 0;
  return 0;
}

/* -- steps ------------------------------------------------------------------------------------ */

/* The next `n` steps of this width end at `end`. */
static void interval(pgraph* p, int64_t n, double width, double end) {
  double now = pgraph_time(p), *times = numbers(p, A_TIMES);
  if (*real_at(p, W_WIDEST) != width) {
    *real_at(p, W_WIDEST) = width;
    *real_at(p, W_ORIGIN) = now;
    *integer_at(p, W_TAKEN) = 0;
  }
  *integer_at(p, W_FRAME) = 1;
  *integer_at(p, W_LAST) = 2;
  *integer_at(p, W_LEFT) = n;
  times[0] = now;
  times[1] = end;
}

static int64_t advance(pgraph* p, int64_t n) {
  arguments a = {.count = 0};
  put_word(&a, run(p));
  put_word(&a, (uint64_t)n);
  if (p->words[W_LOGGED]) *integer_at(p, W_LOGGED) = 0;
  int64_t code = called(w_advance_run, &a);
  p->seen = 0;
  return code;
}

static int went(pgraph* p, int64_t code) {
  if (code == DONE || code == RUNNING) return 0;
  p->state = -1;
  return fail(p, "the run stopped at t = %.6g s: %s", pgraph_time(p),
              code > 0 && code < 7 ? reasons[code] : "a step failed");
}

/* Take `n` given steps, each in as many parts as events within it need. */
static int take(pgraph* p, int64_t n) {
  const int64_t *taken = integer_at(p, W_TAKEN), end = *taken + n;
  while (*taken < end)
    if (went(p, advance(p, end - *taken))) return -1;
  return 0;
}

int pgraph_step(pgraph* p, int64_t n) {
  if (ready(p)) return -1;
  if (p->words[W_BY_TOLERANCE]) return fail(p, "the method chooses its steps; use pgraph_advance");
  if (n < 1) return fail(p, "the number of steps must be at least 1, given %lld", (long long)n);
  interval(p, INT64_MAX, real_word(p, W_STEP), INFINITY);
  return take(p, n);
}

int pgraph_advance(pgraph* p, double duration) {
  if (ready(p)) return -1;
  if (!(duration > 0.0 && isfinite(duration)))
    return fail(p, "the duration must be a number > 0 s, given %g", duration);
  double now = pgraph_time(p), step = real_word(p, W_STEP), end = now + duration;
  if (p->words[W_BY_TOLERANCE]) {
    double* times = numbers(p, A_TIMES);
    times[0] = now;
    times[1] = end;
    *integer_at(p, W_LAST) = 2;
    *integer_at(p, W_FRAME) = 1;
    while (*integer_at(p, W_FRAME) == 1)
      if (went(p, advance(p, 1))) return -1;
    return 0;
  }
  double n = fmax(ceil(duration / step - SAME), 1.0);
  if (fabs(n * step - duration) <= SAME * step) return pgraph_step(p, (int64_t)n);
  interval(p, (int64_t)n, duration / n, end);
  return take(p, (int64_t)n);
}
