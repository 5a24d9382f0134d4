"""Writes mujoco.json: wrenches that MuJoCo gives for scripted motions of the square peg of tests/contact/stiff.toml.

    python3 -m venv venv && venv/bin/pip install mujoco numpy
    venv/bin/python crates/palpate-sim/tests/data/make_mujoco.py

Hole frame, SI units. The tool hangs on three slides and three hinges at the sensor; the sensor's springs are
their position servos, driven by the flange's pose and velocity. Wrench: environment on tool, about the sensor.
"""

import json
import math
import pathlib

import mujoco
import numpy as np

TICK, STEPS = 0.002, 4
K, K_ROT, D, D_ROT = 1e5, 1000.0, 450.0, 4.0
LENGTH, HALF, PEG = 0.150, 0.010, 0.050
EVERY = 10
UP_AND_DOWN = [
    # name, clearance, start of the tip, tilt about y, segments: (velocity, ticks) or (amplitude, hertz, ticks)
    ("press", 2e-4, [0.05, 0.0, 0.001], 0.0, [([0, 0, -0.010], 60), ([0, 0, 0], 150)]),
    ("slide", 2e-4, [0.05, -0.03, 0.001], 0.0, [([0, 0, -0.010], 55), ([0, 0, 0], 100), ([0, 0.010, 0], 400)]),
    ("rim", 2e-4, [0.3e-3, 0.0, 0.001], 0.0, [([0, 0, -0.010], 60), ([0, 0, 0], 200)]),
    ("jam", 2e-4, [0.0, 0.0, 0.002], math.radians(1), [([0, 0, -0.010], 675), ([0, 0, 0], 150)]),
    ("tight jam", 5e-5, [0.0, 0.0, 0.002], math.radians(1), [([0, 0, -0.010], 258), ([0, 0, 0], 150)]),
    ("wiggle", 5e-5, [0.0, 0.0, 0.002], 0.0, [([0, 0, -0.010], 600), (0.15e-3, 2.0, 500)]),
]


def model(clearance):
    hole, wide, deep = HALF + clearance / 2, 0.1, 0.025
    side, plate = (wide - hole) / 2, (wide + hole) / 2
    board = [
        (f"{s * plate} 0 {-deep / 2}", f"{side} {wide} {deep / 2}") for s in (1, -1)
    ] + [(f"0 {s * plate} {-deep / 2}", f"{hole} {side} {deep / 2}") for s in (1, -1)]
    boxes = "".join(f'<geom type="box" pos="{p}" size="{s}"/>' for p, s in board)
    axes = ["1 0 0", "0 1 0", "0 0 1"]
    joints = "".join(f'<joint name="s{i}" type="slide" axis="{a}"/>' for i, a in enumerate(axes))
    joints += "".join(f'<joint name="h{i}" type="hinge" axis="{a}"/>' for i, a in enumerate(axes))
    springs = "".join(f'<position joint="s{i}" kp="{K}" kv="{D}"/>' for i in range(3))
    springs += "".join(f'<position joint="h{i}" kp="{K_ROT}" kv="{D_ROT}"/>' for i in range(3))
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco><compiler angle="radian"/>
      <option timestep="{TICK / STEPS}" gravity="0 0 0" integrator="implicitfast" cone="elliptic"
              iterations="100" tolerance="1e-12"/>
      <default><geom friction="0.3 0 0" condim="3" solref="-2e5 -900" solimp=".95 .99 2e-5 .5 2"/></default>
      <worldbody>{boxes}
        <body name="tool" pos="0 0 {LENGTH}">{joints}
          <inertial pos="0 0 -0.075" mass="1" diaginertia="2e-3 2e-3 6e-4"/>
          <geom type="box" pos="0 0 {-(LENGTH - PEG / 2)}" size="{HALF} {HALF} {PEG / 2}"/>
        </body>
      </worldbody><actuator>{springs}</actuator></mujoco>""")


def run(clearance, start, tilt, segments):
    m = model(clearance)
    data = mujoco.MjData(m)
    sensor = np.array([LENGTH * math.sin(tilt), 0.0, LENGTH * math.cos(tilt) - LENGTH])
    tip = np.array(start, float)
    data.qpos[:3], data.qpos[4] = tip + sensor, tilt
    gain, rate = np.array([K] * 3 + [K_ROT] * 3), np.array([D] * 3 + [D_ROT] * 3)
    rows, tick = [], 0

    def step(target):
        nonlocal tip, tick
        velocity, wrench = (target - tip) / TICK, np.zeros(6)
        for i in range(STEPS):
            pose = np.append(tip + (target - tip) * (i + 1) / STEPS + sensor, [0.0, tilt, 0.0])
            data.ctrl[:] = pose + rate / gain * np.append(velocity, [0.0] * 3)
            mujoco.mj_step(m, data)
            speed = np.append(velocity, [0.0] * 3) - data.qvel
            wrench -= (gain * (pose - data.qpos) + rate * speed) / STEPS
        tip, tick = target, tick + 1
        if tick % EVERY == 0:
            rows.append([round(float(x), 6) for x in wrench])

    for segment in segments:
        if len(segment) == 2:
            for _ in range(segment[1]):
                step(tip + np.array(segment[0]) * TICK)
        else:
            centre, (amplitude, hertz, ticks) = tip.copy(), segment
            for i in range(ticks):
                step(centre + [amplitude * math.sin(2 * math.pi * hertz * (i + 1) * TICK), 0, 0])
    return rows


motions = []
for name, clearance, start, tilt, segments in UP_AND_DOWN:
    print(name)
    script = [
        {"velocity": s[0], "ticks": s[1]} if len(s) == 2 else {"amplitude": s[0], "hertz": s[1], "ticks": s[2]}
        for s in segments
    ]
    motions.append({"name": name, "clearance": clearance, "start": start, "tilt": tilt, "script": script,
                    "wrenches": run(clearance, start, tilt, segments)})
path = pathlib.Path(__file__).with_name("mujoco.json")
path.write_text(json.dumps({"mujoco": mujoco.__version__, "every": EVERY, "motions": motions}) + "\n")
