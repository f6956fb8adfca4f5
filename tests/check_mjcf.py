"""Loads a scene of `grip export` in MuJoCo: what is at rest stays, and everything is there.

    python3 tests/check_mjcf.py SCENE.xml
"""

import sys

import mujoco
import numpy as np


def main():
    model = mujoco.MjModel.from_xml_path(sys.argv[1])
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[:] = model.key_ctrl[0]
    begun = data.qpos.copy()
    objects = [j for j in range(model.njnt) if model.joint(j).name[:1].isdigit()]
    assert objects, "no objects"
    for _ in range(round(1.0 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    for joint in objects:
        at = model.jnt_qposadr[joint]
        moved = np.linalg.norm(data.qpos[at : at + 3] - begun[at : at + 3])
        turned = 2 * np.arccos(min(1.0, abs(data.qpos[at + 3 : at + 7] @ begun[at + 3 : at + 7])))
        name, mass = model.joint(joint).name, model.body_mass[model.jnt_bodyid[joint]]
        print(f"{name}: {mass:.3f} kg, moved by {1e3 * moved:.2f} mm, turned by {np.degrees(turned):.2f} deg")
        assert moved < 3e-3 and turned < np.radians(2), f"{name} was not at rest"
    # The robot hangs on its drives.
    robot = [model.jnt_qposadr[j] for j in range(model.njnt) if model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE]
    assert np.abs(data.qpos[robot] - begun[robot]).max() < 5e-3, "the robot moved"


if __name__ == "__main__":
    main()
