/* Run the model for one second, and print its variables every tenth of a
 * second. */
#include <stdio.h>
#include <stdlib.h>

#include "pgraph.h"

static void *read_file(const char *path, size_t *bytes) {
  FILE *file = fopen(path, "rb");
  if (!file)
    return NULL;
  fseek(file, 0, SEEK_END);
  *bytes = (size_t)ftell(file);
  rewind(file);
  void *found = malloc(*bytes);
  if (found && fread(found, 1, *bytes, file) != *bytes)
    *bytes = 0;
  fclose(file);
  return found;
}

int main(int count, char **given) {
  size_t bytes = 0;
  const char *why = "model.bin cannot be read";
  void *model = read_file(count > 1 ? given[1] : "model.bin", &bytes);
  size_t size = model ? pgraph_size(model, bytes, &why) : 0;
  if (!size) {
    fprintf(stderr, "%s\n", why);
    return 1;
  }
  char *memory = malloc(size + 64);
  if (!memory)
    return 1;
  pgraph *p =
      pgraph_create(model, bytes, memory + (64 - (uintptr_t)memory % 64));
  if (pgraph_start(p, pgraph_first_time(p))) {
    fprintf(stderr, "%s\n", pgraph_message(p));
    return 1;
  }
  for (int k = 0; k < pgraph_count(p); k++)
    printf(k ? ",%s" : "%s", pgraph_name(p, k));
  printf("\n");
  for (int row = 0; row <= 10; row++) {
    for (int k = 0; k < pgraph_count(p); k++) {
      double value = 0.0;
      pgraph_get(p, k, &value);
      printf(k ? ",%.17g" : "%.17g", value);
    }
    printf("\n");
    if (row < 10 && pgraph_advance(p, 0.1)) {
      fprintf(stderr, "%s\n", pgraph_message(p));
      return 1;
    }
  }
  free(memory);
  free(model);
  return 0;
}
