/* What both versions of FMI share. */
#include "fmi.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
#endif

static const double DRIFT = 1e-10; /* change of a state by projection that an importer is told of */
static const double APART = 1e-6;  /* of a step: the importer's time is another one */

static FILE* opened(const char* path) {
#ifdef _WIN32
  wchar_t wide[4096];
  if (!MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, 4096)) return NULL;
  return _wfopen(wide, L"rb");
#else
  return fopen(path, "rb");
#endif
}

static void* read_file(const char* path, size_t* bytes) {
  FILE* file = opened(path);
  if (!file) return NULL;
  void* found = NULL;
  long size = fseek(file, 0, SEEK_END) ? -1 : ftell(file);
  if (size > 0 && !fseek(file, 0, SEEK_SET)) {
    *bytes = (size_t)size;
    found = malloc(*bytes + 8);
    if (found && fread(found, 1, *bytes, file) != *bytes) {
      free(found);
      found = NULL;
    }
  }
  fclose(file);
  return found;
}

status told(component* c, status how, const char* text) {
  if (c->tell && c->log) c->tell(c->log, c->environment, c->name, how, text);
  return how;
}

status checked(component* c, int code) { return code ? told(c, ERROR, pgraph_message(c->p)) : OK; }

void component_free(component* c) {
  if (!c) return;
  free(c->memory);
  free(c->model);
  free(c);
}

static int64_t hash_in(const component* c) {
  return ((const int64_t*)c->model)[c->bytes / 8 - 1];
}

/* The reason why the component cannot be made, or null. */
static const char* load(component* c, const char* token, const char* folder) {
  const char* why = NULL;
  size_t length = strlen(folder), size;
  char *path = malloc(length + 16), own[17];
  if (!path) return "there is no memory";
  snprintf(path, length + 16, "%s%smodel.bin", folder,
           length && folder[length - 1] != '/' && folder[length - 1] != '\\' ? "/" : "");
  c->model = read_file(path, &c->bytes);
  free(path);
  if (!c->model) return "resources/model.bin cannot be read";
  size = pgraph_size(c->model, c->bytes, &why);
  if (!size) return why;
  snprintf(own, sizeof own, "%016llx", (unsigned long long)hash_in(c));
  if (!token || strcmp(token, own)) return "modelDescription.xml belongs to another model.bin";
  c->memory = malloc(size + ALIGNMENT);
  if (!c->memory) return "there is no memory";
  uintptr_t at = (uintptr_t)c->memory;
  c->p = pgraph_create(c->model, c->bytes, (void*)(at + (ALIGNMENT - at % ALIGNMENT)));
  return c->p ? NULL : "the model cannot be loaded";
}

component* component_of(const char* name, const char* token, const char* folder, void* log,
                        void* environment, teller* tell) {
  component* c = calloc(1, sizeof *c);
  if (!c) return NULL;
  c->log = log;
  c->environment = environment;
  c->tell = tell;
  snprintf(c->name, sizeof c->name, "%s", name ? name : "");
  const char* why = load(c, token, folder ? folder : "");
  if (!why) {
    c->start = pgraph_first_time(c->p);
    return c;
  }
  told(c, ERROR, why);
  component_free(c);
  return NULL;
}

/* -- values ----------------------------------------------------------------------------------- */

status get_reals(component* c, const uint32_t* numbers, size_t n, double* values) {
  if (c->initialising && c->p->state == 0 && initialise(c) != OK) return ERROR;
  for (size_t i = 0; i < n; i++)
    if (checked(c, pgraph_get(c->p, (int)numbers[i], values + i)) != OK) return ERROR;
  return OK;
}

status set_reals(component* c, const uint32_t* numbers, size_t n, const double* values) {
  if (c->initialising) c->p->state = 0; /* starts again when it is read, or at the end */
  for (size_t i = 0; i < n; i++)
    if (checked(c, pgraph_set(c->p, (int)numbers[i], values[i])) != OK) return ERROR;
  return OK;
}

status initialise(component* c) { return checked(c, pgraph_start(c->p, c->start)); }

void component_reset(component* c) {
  pgraph_create(c->model, c->bytes, c->p);
  c->start = pgraph_first_time(c->p);
  c->initialising = 0;
}

/* -- co-simulation ---------------------------------------------------------------------------- */

status do_step(component* c, double now, double duration, double* reached) {
  double t = pgraph_time(c->p);
  *reached = t;
  if (!(duration >= 0.0)) return told(c, ERROR, "the step size must be at least 0");
  if (fabs(now - t) > APART * fmax(duration, fabs(t))) {
    char text[128];
    snprintf(text, sizeof text, "a step is asked for at t = %.9g s, but it is t = %.9g s", now, t);
    return told(c, ERROR, text);
  }
  if (duration > 0.0 && checked(c, pgraph_advance(c->p, duration)) != OK) {
    *reached = pgraph_time(c->p);
    return DISCARD;
  }
  *reached = now + duration;
  return OK;
}

/* -- model exchange --------------------------------------------------------------------------- */

size_t state_count(const component* c) {
  return (size_t)(c->p->words[W_COORDINATES] + c->p->words[W_VELOCITIES]);
}

static status right_count(component* c, size_t n) {
  return n == state_count(c) ? OK : told(c, ERROR, "the number of states is another one");
}

status put_states(component* c, const double* x, size_t n) {
  if (right_count(c, n) != OK) return ERROR;
  return checked(c, pgraph_put_state(c->p, pgraph_time(c->p), x));
}

status get_states(component* c, double* x, size_t n) {
  if (right_count(c, n) != OK) return ERROR;
  size_t nq = (size_t)c->p->words[W_COORDINATES];
  memcpy(x, numbers(c->p, A_Q), nq * 8);
  memcpy(x + nq, numbers(c->p, A_V), (n - nq) * 8);
  return OK;
}

status get_rates(component* c, double* rates, size_t n) {
  const double* found;
  if (right_count(c, n) != OK) return ERROR;
  if (checked(c, pgraph_derivatives(c->p, &found)) != OK) return ERROR;
  memcpy(rates, found, n * 8);
  return OK;
}

status set_time(component* c, double t) {
  if (c->p->state != 1) return told(c, ERROR, "the time is set after the initialization");
  *real_at(c->p, W_TIME) = t;
  *integer_at(c->p, W_FRESH) = 0;
  c->p->seen = 0;
  return OK;
}

/* After a step: constraints and quaternions may have drifted. The states change in event mode. */
status completed(component* c, int* enter_event_mode) {
  double moved = 0.0;
  status how = checked(c, drift(c->p, &moved));
  *enter_event_mode = moved > DRIFT;
  return how;
}

status put_back(component* c, int* changed) {
  double moved = 0.0;
  status how = c->p->state == 1 ? checked(c, pgraph_project(c->p, &moved)) : OK;
  *changed = moved > 0.0;
  return how;
}

int next_event(const component* c, double* t) {
  const int64_t* instants = section(c->p, W_INSTANTS);
  int64_t i = 0, n = c->p->words[W_INSTANT_COUNT];
  while (i < n && real(instants + i) <= pgraph_time(c->p)) i++;
  *t = i < n ? real(instants + i) : 0.0;
  return i < n;
}

/* -- directional derivatives ------------------------------------------------------------------ */

enum { HALVINGS = 10 };                /* of the change of the knowns, from WIDEST on */
static const double WIDEST = 0.0625; /* rad, m, N or N m, for example */

typedef struct {
  double row[HALVINGS], found, error;
} extrapolation;

/* Add central difference n to Neville's scheme in the square of the change. The entry that differs
   least from its neighbours is kept, as by Ridders (1982). */
static void extrapolate(extrapolation* e, int n, double x) {
  double factor = 1.0;
  for (int j = 0; j < n; j++) {
    double last = e->row[j], better = x + (x - last) / ((factor *= 4.0) - 1.0);
    double error = fmax(fabs(better - x), fabs(better - last));
    if ((n == 1 && !j) || error < e->error) {
      e->found = better;
      e->error = error;
    }
    e->row[j] = x;
    x = better;
  }
  e->row[n] = x;
}

status directional(component* c, const uint32_t* unknowns, size_t n, const uint32_t* knowns,
                   size_t m, const double* seed, double* found) {
  double most = 0.0;
  if (c->initialising && c->p->state == 0 && initialise(c) != OK) return ERROR;
  for (size_t i = 0; i < m; i++) most = fmax(most, fabs(seed[i]));
  memset(found, 0, n * sizeof *found);
  if (!n || most == 0.0) return OK;
  extrapolation* each = calloc(n, sizeof *each + 2 * sizeof(double));
  double width = WIDEST / most, *values = (double*)(each + n);
  void* kept = malloc(pgraph_state_size(c->p));
  int code = 0;
  if (!each || !kept) return free(each), free(kept), told(c, ERROR, "there is no memory");
  pgraph_save(c->p, kept);
  for (int row = 0; row < HALVINGS && !code; row++, width /= 2.0) {
    for (int side = 0; side < 2 && !code; side++, width = -width) {
      code = pgraph_restore(c->p, kept);
      for (size_t i = 0; i < m && !code; i++) code = move(c->p, (int)knowns[i], width * seed[i]);
      for (size_t i = 0; i < n && !code; i++)
        code = pgraph_get(c->p, (int)unknowns[i], values + side * n + i);
    }
    for (size_t i = 0; i < n; i++)
      extrapolate(each + i, row, (values[i] - values[n + i]) / (2.0 * width));
  }
  for (size_t i = 0; i < n; i++) found[i] = each[i].found;
  status how = checked(c, code);
  pgraph_restore(c->p, kept);
  free(each);
  free(kept);
  return how;
}

/* -- copies of the state ---------------------------------------------------------------------- */

static int fits(const component* c, const copy* from) {
  return from && from->bytes == pgraph_state_size(c->p) && from->model == hash_in(c);
}

status copy_state(component* c, void** state) {
  copy* made = malloc(serialised_size(c));
  free(*state);
  *state = made;
  if (!made) return told(c, ERROR, "there is no memory");
  *made = (copy){.bytes = pgraph_state_size(c->p), .start = c->start, .model = hash_in(c)};
  pgraph_save(c->p, made->memory);
  return OK;
}

status restored(component* c, const copy* from) {
  if (!fits(c, from)) return told(c, ERROR, "the state is not one of this model");
  c->start = from->start;
  c->initialising = 0;
  return checked(c, pgraph_restore(c->p, from->memory));
}

size_t serialised_size(const component* c) { return sizeof(copy) + pgraph_state_size(c->p); }

status serialise(component* c, const copy* from, char* to, size_t size) {
  if (!from || size < serialised_size(c)) return told(c, ERROR, "the buffer is too small");
  memcpy(to, from, serialised_size(c));
  return OK;
}

status deserialise(component* c, const char* from, size_t size, void** state) {
  size_t needed = serialised_size(c);
  copy* made = *state = malloc(needed);
  if (made && size >= needed) memcpy(made, from, needed);
  if (made && size >= needed && fits(c, made)) return OK;
  free(made);
  *state = NULL;
  return told(c, ERROR, "the serialised state is not one of this model");
}
