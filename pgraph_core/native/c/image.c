/* Load the file of a model into memory, and give kernels their arguments. */
#include "image.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#ifdef __x86_64__
#include <xmmintrin.h>
#endif

/* Kernels that others call by address, in the order of LINKED in library.py. */
#define LINKED(use)                                                                                \
  use(acceleration) use(projection) use(record) use(constrain) use(semi_implicit) use(runge_kutta) \
      use(cross) use(moreau_jean) use(find) use(contact_forces) use(record_contacts)               \
          use(settle_contacts) use(bound_step) use(walking)
#define DECLARED(name) void k_##name(void);
#define ADDRESS(name) k_##name,
LINKED(DECLARED)
static void (*const linked[])(void) = {LINKED(ADDRESS)};

extern const char kernels_digest[]; /* generated: 8 letters */

const char* pgraph_kernels(void) { return kernels_digest; }

static int64_t word_of(const char* letters) {
  int64_t found;
  memcpy(&found, letters, 8);
  return found;
}

static int outside(const int64_t* w, int at, int64_t count, int64_t size) {
  int64_t bytes = w[W_FILE_BYTES];
  return w[at] < 8 * W_COUNT || count < 0 || w[at] % 8 || w[at] > bytes ||
         count > (bytes - w[at]) / size;
}

static int64_t hash_of(const unsigned char* bytes, size_t count) {
  uint64_t found = 14695981039346656037u; /* FNV-1a over words */
  for (size_t i = 0; i + 8 <= count; i += 8) {
    uint64_t word;
    memcpy(&word, bytes + i, 8);
    found = (found ^ word) * 1099511628211u;
  }
  return (int64_t)found;
}

/* The reason why these bytes are no model for this library, or null. */
const char* image_problem(const void* model, size_t bytes) {
  const int64_t* w = model;
  if (!model || bytes < 8 * (W_COUNT + 1) || (uintptr_t)model % 8 ||
      w[W_MAGIC] != word_of("PGRAPHM\n"))
    return "this is no file of a model, written by pg.write_c or pg.write_fmu";
  if (w[W_FORM] != FORM || w[W_KERNELS] != word_of(kernels_digest))
    return "the model was written by another version of Pgraph than this library";
  if (w[W_FILE_BYTES] != (int64_t)bytes || bytes % 8 ||
      hash_of(model, bytes - 8) != w[bytes / 8 - 1])
    return "the file of the model is damaged";
  if (outside(w, W_IMAGE, w[W_IMAGE_BYTES], 1) || outside(w, W_ARRAYS, A_COUNT, 48) ||
      outside(w, W_RELOCATIONS, w[W_RELOCATION_COUNT], 8) ||
      outside(w, W_LINKS, w[W_LINK_COUNT], 16) ||
      outside(w, W_VARIABLES, w[W_VARIABLE_COUNT], 8 * V_WORDS) ||
      outside(w, W_EFFECTS, w[W_EFFECT_COUNT], 8 * E_WORDS) ||
      outside(w, W_SPINS, w[W_SPIN_COUNT], 16) || outside(w, W_SLIDES, w[W_SLIDE_COUNT], 16) ||
      outside(w, W_INSTANTS, w[W_INSTANT_COUNT], 8))
    return "the file of the model is damaged";
  return NULL;
}

const int64_t* section(const pgraph* p, int word) { return p->words + p->words[word] / 8; }
const int64_t* array_of(const pgraph* p, int which) { return section(p, W_ARRAYS) + 6 * which; }
double* numbers(const pgraph* p, int which) { return (double*)(p->image + array_of(p, which)[0]); }
int64_t* integer_at(const pgraph* p, int word) { return (int64_t*)(p->image + p->words[word]); }
double* real_at(const pgraph* p, int word) { return (double*)(p->image + p->words[word]); }
double real(const int64_t* word) {
  double found;
  memcpy(&found, word, 8);
  return found;
}
double real_word(const pgraph* p, int word) { return real(p->words + word); }

/* Move all addresses in a copy of the image by a distance. */
static void image_shift(const pgraph* p, unsigned char* memory, int64_t by) {
  const int64_t* places = section(p, W_RELOCATIONS);
  for (int64_t i = 0; i < p->words[W_RELOCATION_COUNT]; i++) *(int64_t*)(memory + places[i]) += by;
}

/* Give the image its own addresses. */
static void arrive(pgraph* p) {
  const int64_t* links = section(p, W_LINKS);
  image_shift(p, p->image, (int64_t)(uintptr_t)p->image - p->words[W_BASE]);
  for (int64_t i = 0; i < p->words[W_LINK_COUNT]; i++)
    *(uint64_t*)(p->image + links[2 * i]) = (uintptr_t)linked[links[2 * i + 1]];
}

/* Everything as it was written, but the values that the user set. */
void image_load(pgraph* p) {
  const int64_t* w = p->words;
  memcpy(p->image, (const unsigned char*)w + w[W_IMAGE], (size_t)w[W_VALUES]);
  arrive(p);
}

size_t pgraph_state_size(const pgraph* p) { return (size_t)p->words[W_IMAGE_BYTES] + 16; }

void pgraph_save(const pgraph* p, void* state) {
  unsigned char* out = state;
  const int64_t size = p->words[W_IMAGE_BYTES], first[2] = {p->state, 0};
  memcpy(out, first, 16);
  memcpy(out + 8, &p->began, 8);
  memcpy(out + 16, p->image, (size_t)size);
  image_shift(p, out + 16, p->words[W_BASE] - (int64_t)(uintptr_t)p->image);
  const int64_t* links = section(p, W_LINKS);
  for (int64_t i = 0; i < p->words[W_LINK_COUNT]; i++) memset(out + 16 + links[2 * i], 0, 8);
}

int pgraph_restore(pgraph* p, const void* state) {
  const unsigned char* in = state;
  int64_t how;
  memcpy(&how, in, 8);
  if (how < -1 || how > 1) return fail(p, "this is no state of an instance of this model");
  memcpy(&p->began, in + 8, 8);
  memcpy(p->image, in + 16, (size_t)p->words[W_IMAGE_BYTES]);
  arrive(p);
  p->state = (int)how;
  p->seen = 0;
  return 0;
}

int fail(pgraph* p, const char* text, ...) {
  va_list rest;
  va_start(rest, text);
  vsnprintf(p->message, sizeof p->message, text, rest);
  va_end(rest);
  return -1;
}

const char* pgraph_message(const pgraph* p) { return p->message; }

/* -- kernels ---------------------------------------------------------------------------------- */

/* Kernels need the usual mode for numbers, which the host may have changed: to nearest, with
   subnormal numbers and without traps. */
#if defined(__x86_64__)
static uint64_t mode_begin(void) {
  uint64_t before = _mm_getcsr();
  _mm_setcsr(0x1f80);
  return before;
}
static void mode_end(uint64_t before) { _mm_setcsr((uint32_t)before); }
#elif defined(__aarch64__)
static uint64_t mode_begin(void) {
  uint64_t before, usual = 0;
  __asm__ volatile("mrs %0, fpcr" : "=r"(before));
  __asm__ volatile("msr fpcr, %0" : : "r"(usual));
  return before;
}
static void mode_end(uint64_t before) { __asm__ volatile("msr fpcr, %0" : : "r"(before)); }
#else
#error "no floating-point mode for this processor"
#endif

void put_word(arguments* a, uint64_t word) { a->words[a->count++] = word; }

void put_real(arguments* a, double x) {
  uint64_t word;
  memcpy(&word, &x, 8);
  put_word(a, word);
}

/* Owner, parent, number of entries, bytes of each, place, lengths, strides, as `calls.py` does. */
void put_array(arguments* a, const pgraph* p, int which) {
  const int64_t *one = array_of(p, which), axes = one[2];
  int64_t count = 1, strides[3], step = one[1];
  for (int64_t i = axes - 1; i >= 0; i--) {
    strides[i] = step;
    step *= one[3 + i];
    count *= one[3 + i];
  }
  put_word(a, 0);
  put_word(a, 0);
  put_word(a, (uint64_t)count);
  put_word(a, (uint64_t)one[1]);
  put_word(a, (uintptr_t)(p->image + one[0]));
  for (int64_t i = 0; i < axes; i++) put_word(a, (uint64_t)one[3 + i]);
  for (int64_t i = 0; i < axes; i++) put_word(a, (uint64_t)strides[i]);
}

int64_t called(kernel* k, arguments* a) {
  uint64_t results[8] = {0};
  uint64_t before = mode_begin();
  k(a->words, results);
  mode_end(before);
  return (int64_t)results[0];
}
