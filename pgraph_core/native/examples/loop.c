/* A loop with a fixed step, as a controller or a test rig has it: memory is
   given once, and nothing is allocated. The model is in the program, and not in
   a file. Make model_data.c by

     xxd -i model.bin > model_data.c

   and replace `unsigned char` in it by `_Alignas(64) unsigned char`. */
#include <stdio.h>
#include <time.h>

#include "pgraph.h"

extern unsigned char model_bin[];
extern unsigned int model_bin_len;

enum { MEMORY = 1 << 20 }; /* at least what `pgraph_size` says */
static _Alignas(64) unsigned char memory[MEMORY];

static double now(void) {
  struct timespec t;
  timespec_get(&t, TIME_UTC);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int main(void) {
  const char *why = "";
  size_t size = pgraph_size(model_bin, model_bin_len, &why);
  if (!size || size > MEMORY) {
    printf("%s\n", size ? "give more memory" : why);
    return 1;
  }
  pgraph *p = pgraph_create(model_bin, model_bin_len, memory);
  if (pgraph_start(p, pgraph_first_time(p)))
    return 1;
  double longest = 0.0;
  for (int tick = 0; tick < 1000; tick++) {
    double began = now();
    /* read your sensors here, and set inputs by pgraph_set(p, input, value) */
    if (pgraph_step(p, 1)) {
      printf("%s\n", pgraph_message(p));
      return 1;
    }
    double took = now() - began;
    if (took > longest)
      longest = took;
    /* write your outputs here, and wait for the next tick */
  }
  printf("t = %.17g s, longest step %.3g us\n", pgraph_time(p), 1e6 * longest);
  return 0;
}
