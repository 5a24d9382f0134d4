"""Writes pinocchio.json: poses and Jacobians of our arms, computed by pinocchio.

    python -m venv venv && venv/bin/pip install pin==4.1.0 && venv/bin/python make_pinocchio.py

Poses are of the tip in base-link axes, quaternions w x y z with w >= 0. Jacobian rows are linear then angular
velocity of the tip's origin, base-link axes, stored row by row. Angles are uniform in +-2 pi (the elbow +-pi),
other joints uniform within their limits. The UR figures are also checked against the product of their published
Denavit-Hartenberg transforms, which shares no code with pinocchio or with the URDF.
"""

import json
from pathlib import Path

import numpy as np
import pinocchio as pin

HERE = Path(__file__).resolve().parent
ROBOTS = HERE.parents[3] / "assets" / "robots"
ARMS = [
    ("ur3e", ROBOTS / "ur3e.urdf", "base_link", "tool0"),
    ("ur5e", ROBOTS / "ur5e.urdf", "base_link", "tool0"),
    ("ur10e", ROBOTS / "ur10e.urdf", "base_link", "tool0"),
    ("odd_arm", HERE / "odd_arm.urdf", "plate", "tool"),
]
# d1 a2 a3 d4 d5 d6
FIGURES = {
    "ur3e": (0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921),
    "ur5e": (0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
    "ur10e": (0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655),
}
CONFIGURATIONS = 16


def dh_product(name, q):
    d1, a2, a3, d4, d5, d6 = FIGURES[name]
    T = np.diag([-1.0, -1.0, 1.0, 1.0])
    rows = zip(q, (d1, 0, 0, d4, d5, d6), (0, a2, a3, 0, 0, 0), (np.pi / 2, 0, 0, np.pi / 2, -np.pi / 2, 0))
    for theta, d, a, alpha in rows:
        c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        T = T @ [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
    return T


def sample(model, joint, rng):
    """One position, and what pinocchio wants for it: (cos, sin) of a continuous joint."""
    if joint.nq == 2:
        angle = rng.uniform(-2 * np.pi, 2 * np.pi)
        return angle, [np.cos(angle), np.sin(angle)]
    low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
    position = rng.uniform(low, high)
    return position, [position]


def main():
    rng = np.random.default_rng(20201)
    arms = {}
    for name, path, base, tip in ARMS:
        model = pin.buildModelFromUrdf(str(path))
        data = model.createData()
        base_id, tip_id = model.getFrameId(base), model.getFrameId(tip)
        # No moving joint lies above the base, so every configuration moves only what is below it.
        cases = []
        for _ in range(CONFIGURATIONS):
            positions, raw = zip(*(sample(model, joint, rng) for joint in model.joints[1:]))
            q = np.concatenate(raw)
            pin.forwardKinematics(model, data, q)
            pin.updateFramePlacements(model, data)
            world_M_base, world_M_tip = data.oMf[base_id], data.oMf[tip_id]
            base_M_tip = world_M_base.actInv(world_M_tip)
            J = pin.computeFrameJacobian(model, data, q, tip_id, pin.LOCAL_WORLD_ALIGNED)
            R = world_M_base.rotation.T
            J = np.vstack([R @ J[:3], R @ J[3:]])
            if name in FIGURES:
                T = dh_product(name, positions)
                assert np.abs(T - base_M_tip.homogeneous).max() < 1e-14, name
            x, y, z, w = pin.Quaternion(base_M_tip.rotation).coeffs()
            sign = 1.0 if w >= 0 else -1.0
            cases.append({
                "q": list(positions),
                "position": base_M_tip.translation.tolist(),
                "quaternion_wxyz": [sign * c for c in (w, x, y, z)],
                "jacobian": J.tolist(),
            })
        arms[name] = {"base": base, "tip": tip, "cases": cases}
    out = {"pinocchio": pin.__version__, "arms": arms}
    (HERE / "pinocchio.json").write_text(json.dumps(out, indent=None, separators=(",", ":")) + "\n")


main()
