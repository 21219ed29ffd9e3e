"""The rig as equations: parameters, friction laws, motor, dynamics, energy, sensors."""
