/* Where an emulator finds the functions: these addresses stand at the start of the image, in this order. */
#include <stdint.h>

extern uint8_t sim_bytes[];
void sim_open(float, uint32_t, uint32_t, float, uint32_t);
void sim_receive(int);
uint32_t sim_tick(uint32_t, int32_t, int32_t, uint32_t, int);
int sim_output(void);
void sim_steps(int, const double *, double *, const double *, double *, double *);

__attribute__((section(".table"), used)) void *const sim_table[] = {
    (void *)sim_open, (void *)sim_receive, (void *)sim_tick, (void *)sim_output, (void *)sim_steps, sim_bytes,
};
