/* The file of a model: words of 8 bytes, as `image.py` writes them by the names below. */
#ifndef IMAGE_H
#define IMAGE_H

#include "pgraph.h"

enum { FORM = 1 }; /* version of the file */

/* Words at the start of the file. Names of fields are offsets [bytes] from the image's begin. */
// clang-format off
enum word {
  W_MAGIC, W_FORM, W_KERNELS, W_FILE_BYTES, W_IMAGE, W_IMAGE_BYTES, W_VALUES, W_BASE,
  W_RELOCATIONS, W_RELOCATION_COUNT, W_LINKS, W_LINK_COUNT, W_LENGTHS, W_LENGTH_COUNT, W_COPIES,
  W_COPY_COUNT, W_ARRAYS, W_VARIABLES, W_VARIABLE_COUNT, W_EFFECTS, W_EFFECT_COUNT, W_SPINS,
  W_SPIN_COUNT, W_SLIDES, W_SLIDE_COUNT, W_SCENE, W_RUN, W_TIME, W_WIDTHS, W_RTOL, W_WIDEST,
  W_ORIGIN, W_TAKEN, W_FRAME, W_LAST, W_LEFT, W_SPAN, W_FRESH, W_LOGGED, W_STATE_ROW, W_CHOSEN,
  W_GIVEN, W_ADAPTIVE, W_BY_TOLERANCE, W_PROJECT, W_BOUNDED, W_MOVABLE, W_START, W_STEP,
  W_TOLERANCE, W_FIXED_TOLERANCE, W_USUAL_SPAN, W_ROWS, W_MASS, W_LINK, W_COM, W_INERTIA, W_MOVES,
  W_COORDINATES, W_VELOCITIES, W_LOADED, W_INSTANTS, W_INSTANT_COUNT, W_COUNT,
};
// clang-format on

/* Arrays, each with six words: offset in the image, bytes of an entry, axes, at most three lengths.
 */
// clang-format off
enum array {
  A_PARENT, A_BODY, A_MOTION, A_START, A_TRACKS, A_ROWS, A_CONST, A_BODIES_I, A_BODIES_F, A_HOME,
  A_Q, A_V, A_TRIAL, A_GIVEN, A_FLOW, A_VDOT, A_WRENCHES, A_TIMES, A_SENSORS, A_GRAVITY,
  A_FRAME_Q, A_FRAME_V, A_FRAME_VDOT, A_EXTERNAL, A_WORK, A_POSITION, A_ROTATION, A_VELOCITY,
  A_ACCELERATION, A_FORCE, A_POSE, A_READINGS, A_X, A_LOADS, A_COUNT,
};
// clang-format on

/* Coordinates whose rates are velocities: pairs of their numbers. Spins: pairs of the first numbers
   of a quaternion and of its angular velocity in the axes of the parent. */

/* A variable: its kind, where it is read (-1: its value), its effects, and its name in the file. */
enum { V_KIND, V_READ, V_FIRST_EFFECT, V_EFFECTS, V_NAME, V_LOW, V_HIGH, V_WORDS };
/* An effect: the number at a place becomes start + slope value within bounds. The table of bodies
   is packed afterwards, or a drive follows with its lag. */
enum { E_PLACE, E_START, E_SLOPE, E_LOW, E_HIGH, E_PACKS, E_LAG, E_WORDS };

struct pgraph {
  const int64_t* words; /* of the file */
  unsigned char* image;
  double* values; /* set by the user, within the image, one for each variable */
  double began;
  int state; /* 0: not started, 1: started, -1: failed */
  int seen;  /* bits: 1 readings, 2 derivatives belong to the present state */
  char message[256];
};

enum { ALIGNMENT = 64 };

const char* image_problem(const void* model, size_t bytes);
void image_load(pgraph* p);
const int64_t* array_of(const pgraph* p, int which);
double* numbers(const pgraph* p, int which);
int64_t* integer_at(const pgraph* p, int word);
double* real_at(const pgraph* p, int word);
double real(const int64_t* word);
double real_word(const pgraph* p, int word);
const int64_t* section(const pgraph* p, int word);
int fail(pgraph* p, const char* text, ...);

int accelerate(pgraph* p);
/* Move a state, an input or the time of a run, whatever their bounds. -1 for other variables. */
int move(pgraph* p, int k, double by);
/* How far projection moves the state, which it leaves. The moved one is in A_TRIAL. */
int drift(pgraph* p, double* moved);
/* Readings of the outputs at the present state. Null with a message if there are none. */
const double* readings(pgraph* p);

/* Kernels, called with words for their arguments. */
typedef int kernel(uint64_t* words, uint64_t* results);
kernel w_advance_run, w_projection, w_constrained_dynamics, w_bound_step, w_pack, w_followed,
    w_motion_and_forces, w_as_quaternions, w_read_sensors, w_load_wrenches;

typedef struct {
  uint64_t words[160];
  int count;
} arguments;
void put_word(arguments* a, uint64_t word);
void put_real(arguments* a, double x);
void put_array(arguments* a, const pgraph* p, int which);
int64_t called(kernel* k, arguments* a);

#endif
