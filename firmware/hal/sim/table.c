/* Where an emulator finds the functions: these addresses stand at the start of the image, in this order. */
#include <stdint.h>

extern uint8_t sim_bytes[];
void sim_open(float, uint32_t, uint32_t, float, uint32_t, float);
void sim_receive(int);
uint32_t sim_tick(uint32_t, int32_t, int32_t, uint32_t, int);
int sim_output(void);
void sim_steps(int, const double *, double *, const double *, double *, double *);

__attribute__((section(".table"), used)) const uintptr_t sim_table[] = {
    (uintptr_t)sim_open,   (uintptr_t)sim_receive, (uintptr_t)sim_tick,
    (uintptr_t)sim_output, (uintptr_t)sim_steps,   (uintptr_t)sim_bytes,
};
