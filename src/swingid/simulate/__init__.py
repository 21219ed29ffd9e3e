"""The digital twin: one closed loop, sampled controller, held voltage."""
