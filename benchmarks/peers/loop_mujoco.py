"""MuJoCo: the pendulum and its wheel as two hinges, stepped at 10 kHz under the controller's held voltage.

The rotor, which turns N times as fast as the wheel, is represented exactly by the wheel's inertia J2 + N Jr, an
armature of N (N - 1) Jr on its joint, and J1 + (1 - N) Jr of the body: together they give a11, a12 and a22. Its default
frictionloss creeps, so solreffriction is as short as two steps, which is the least that MuJoCo takes.
"""

from __future__ import annotations

import numpy as np
from problem import Motor, motor, read

import swingid as sw

NAME, PACKAGES = "MuJoCo, steps of 0.1 ms", ("mujoco",)
STEP = 1e-4


def model_of(rig: sw.Rig, friction: bool = True) -> object:
    """The rig as a MuJoCo model; without `friction` of axis, motor and gear."""
    import mujoco

    m, axis = motor(rig), rig.axis
    law = axis.friction
    own = axis.inertia.value + (1 - m.gear) * m.Jr
    length = 0.1
    mass = m.b / (9.81 * length)
    own -= mass * length**2
    wheel, armature = m.J2 + m.gear * m.Jr, m.gear * (m.gear - 1) * m.Jr
    on = 1.0 if friction else 0.0
    damping = on * (law.viscous.value if law.viscous else 0.0)
    dry = on * (law.coulomb.value if law.coulomb else 0.0)
    hard = f'solreffriction="{2 * STEP} 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"'
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option timestep="{STEP}" integrator="RK4" gravity="0 0 -9.81" tolerance="1e-14">
        <flag contact="disable" energy="enable"/>
      </option>
      <compiler autolimits="true" balanceinertia="true" boundmass="0" boundinertia="0"/>
      <worldbody>
        <body>
          <joint name="axis" type="hinge" axis="0 -1 0" damping="{damping}" frictionloss="{dry}" {hard}/>
          <inertial pos="0 0 {-length}" mass="{mass}" diaginertia="{own} {own} {own}"/>
          <body>
            <joint name="wheel" type="hinge" axis="0 -1 0" armature="{armature}" damping="{on * m.gear**2 * m.f2}"
                   frictionloss="{on * m.gear * m.f3}" {hard}/>
            <inertial pos="0 0 0" mass="1e-6" diaginertia="{wheel} {wheel} {wheel}"/>
          </body>
        </body>
      </worldbody>
    </mujoco>""")


def torque(m: Motor, u: float, speed: float) -> float:
    """Torque of the motor on the wheel's joint without its friction (N m), (8)."""
    live = m.eta * (m.c1 * u - m.c2 * speed)
    return m.gear * (live - m.d1 if live > m.d1 else live - m.d2 if live < m.d2 else 0.0)


def closed_loop(rig: sw.Rig, reference: np.ndarray, rate: float) -> np.ndarray:
    """Readings and voltage (rows, 3) of the loop."""
    import mujoco

    model, m = model_of(rig), motor(rig)
    data = mujoco.MjData(model)
    controller = sw.Compensator.paper(rig)
    state = controller.initial_state(0.0)
    steps = round(1.0 / (rate * STEP))
    log = np.empty((len(reference), 3))
    for k, wanted in enumerate(reference):
        angle, wheel = read(data.qpos, rig)
        u, state = controller.step(k / rate, (wanted, angle, wheel), state)
        log[k] = angle, wheel, u
        for _ in range(steps):
            data.qfrc_applied[1] = torque(m, u, data.qvel[1])
            mujoco.mj_step(model, data)
    return log


def free_swing(rig: sw.Rig, first: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """(angles (rows, 2), energy (rows,)) of a swing from rest without friction and voltage, every 1 ms."""
    import mujoco

    model = model_of(rig, friction=False)
    data = mujoco.MjData(model)
    data.qpos[0] = first
    angles, energies = [], []
    for _ in range(round(duration * 1000) + 1):
        mujoco.mj_forward(model, data)
        angles.append(data.qpos.copy())
        energies.append(float(data.energy.sum()))
        mujoco.mj_step(model, data, round(1e-3 / STEP))
    return np.array(angles), np.array(energies)
