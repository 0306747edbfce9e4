/* The functions of FMI that have the same form in both versions. Each version includes this once,
   with V(name), V_STATE(before, after) for copies of the state, and DESERIALISE for its names. */
PGRAPH_API void V(FreeInstance)(void* c) { component_free(c); }
PGRAPH_API status V(Terminate)(void*) { return OK; }
PGRAPH_API status V(Reset)(void* c) { return component_reset(c), OK; }
PGRAPH_API status V(ExitInitializationMode)(void* of) {
  component* c = of;
  c->initialising = 0;
  return c->p->state == 1 ? OK : initialise(c);
}
PGRAPH_API status V_STATE(Get, )(void* c, void** state) { return copy_state(c, state); }
PGRAPH_API status V_STATE(Set, )(void* c, void* state) { return restored(c, state); }
PGRAPH_API status V_STATE(Free, )(void*, void** state) {
  if (state) free(*state), *state = NULL;
  return OK;
}
PGRAPH_API status V_STATE(Serialized, Size)(void* c, void*, size_t* size) {
  return *size = serialised_size(c), OK;
}
PGRAPH_API status V_STATE(Serialize, )(void* c, void* state, char to[], size_t size) {
  return serialise(c, state, to, size);
}
PGRAPH_API status DESERIALISE(void* c, const char from[], size_t size, void** state) {
  return deserialise(c, from, size, state);
}

PGRAPH_API status V(EnterEventMode)(void*) { return OK; }
PGRAPH_API status V(EnterContinuousTimeMode)(void*) { return OK; }
PGRAPH_API status V(SetTime)(void* c, double t) { return set_time(c, t); }
PGRAPH_API status V(SetContinuousStates)(void* c, const double x[], size_t n) {
  return put_states(c, x, n);
}
PGRAPH_API status V(GetContinuousStates)(void* c, double x[], size_t n) {
  return get_states(c, x, n);
}
PGRAPH_API status V(GetEventIndicators)(void* c, double[], size_t n) {
  return n ? told(c, ERROR, NEVER) : OK;
}
PGRAPH_API status V(GetNominalsOfContinuousStates)(void*, double values[], size_t n) {
  for (size_t i = 0; i < n; i++) values[i] = 1.0;
  return OK;
}
