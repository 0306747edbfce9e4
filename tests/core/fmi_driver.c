/* Calls the functions of FMI 3 once more than an importer would. Arguments: the token of model.bin,
   the numbers of its first and last state, and their count. */
#include <stdio.h>
#include <stdlib.h>
#include "fmi.h"
void* fmi3InstantiateCoSimulation(const char*, const char*, const char*, bool, bool, bool, bool,
                                  const reference[], size_t, void*, void*, void*);
status fmi3EnterInitializationMode(void*, bool, double, double, bool, double);
status fmi3ExitInitializationMode(void*), fmi3Reset(void*), fmi3FreeFMUState(void*, void**);
status fmi3GetFMUState(void*, void**), fmi3SetFMUState(void*, void*);
status fmi3SerializedFMUStateSize(void*, void*, size_t*);
status fmi3SerializeFMUState(void*, void*, char[], size_t);
status fmi3DeserializeFMUState(void*, const char[], size_t, void**);
status fmi3DoStep(void*, double, double, bool, bool*, bool*, bool*, double*);
status fmi3GetDirectionalDerivative(void*, const reference[], size_t, const reference[], size_t,
                                    const double[], size_t, double[], size_t);
status fmi3UpdateDiscreteStates(void*, bool*, bool*, bool*, bool*, bool*, double*);
status fmi3CompletedIntegratorStep(void*, bool, bool*, bool*);
status fmi3GetContinuousStates(void*, double[], size_t);
status fmi3SetContinuousStates(void*, const double[], size_t);
status fmi3GetContinuousStateDerivatives(void*, double[], size_t);
void fmi3FreeInstance(void*);
static void say(void*, status, const char*, const char* text) { printf("%s\n", text); }
#define DO(call) if ((call) != OK) return printf("%s\n", #call), 1
int main(int, char** given) {
  reference first = (reference)atoi(given[2]), last = (reference)atoi(given[3]);
  bool a, b, c, d, e;
  double t, seed = 1.0, found, *x = malloc(8 * (size_t)atoi(given[4]));
  size_t size, n = (size_t)atoi(given[4]);
  if (fmi3InstantiateCoSimulation("m", "x", ".", 0, 0, 0, 0, NULL, 0, NULL, say, NULL)) return 1;
  void* p = fmi3InstantiateCoSimulation("m", given[1], ".", 0, 0, 0, 0, NULL, 0, NULL, say, NULL);
  if (!p) return 1;
  for (int round = 0; round < 2; round++) {
    void *kept = NULL, *copy = NULL, *none = NULL;
    DO(fmi3EnterInitializationMode(p, 0, 0, 0, 0, 0));
    DO(fmi3ExitInitializationMode(p));
    DO(fmi3DoStep(p, 0.0, 0.02, 1, &a, &b, &c, &t));
    DO(fmi3GetFMUState(p, &kept));
    DO(fmi3SerializedFMUStateSize(p, kept, &size));
    char* bytes = malloc(size);
    DO(fmi3SerializeFMUState(p, kept, bytes, size));
    DO(fmi3DeserializeFMUState(p, bytes, size, &copy));
    if (fmi3DeserializeFMUState(p, bytes, 10, &none) == OK) return 1;
    DO(fmi3DoStep(p, 0.02, 0.0123, 1, &a, &b, &c, &t));
    DO(fmi3SetFMUState(p, kept));
    DO(fmi3GetDirectionalDerivative(p, &last, 1, &first, 1, &seed, 1, &found, 1));
    DO(fmi3GetContinuousStates(p, x, n));
    DO(fmi3SetContinuousStates(p, x, n));
    DO(fmi3GetContinuousStateDerivatives(p, x, n));
    DO(fmi3CompletedIntegratorStep(p, 1, &a, &b));
    DO(fmi3UpdateDiscreteStates(p, &a, &b, &c, &d, &e, &t));
    fmi3FreeFMUState(p, &kept);
    fmi3FreeFMUState(p, &copy);
    free(bytes);
    DO(fmi3Reset(p));
  }
  fmi3FreeInstance(p);
  free(x);
  return 0;
}
