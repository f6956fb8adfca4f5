"""Tries the grasps of a sweep again in MuJoCo and tells how far the two worlds agree.

    grip sweep --motions --out runs/sweep
    python3 tests/crosscheck.py runs/sweep [--limit N] [--jobs J] [--nudge MM] [--out FILE] [--sweep-out DIR]

The hand is a body that goes where the sweep's motions say; fingers, object and table are MuJoCo's: its contacts, friction and solver, on
the convex pieces, masses and frictions of `mjcf/OBJECT.xml`. The same clauses decide, with the sweep's settings: both fingers pressed from opposite sides, lifted by
3 cm clear of everything, still so at the end of the shake, slipped by at most 20 mm and 20 degrees. Needs `mujoco` of PyPI.
"""

import argparse
import json
import math
import multiprocessing
import sys
from collections import Counter
from pathlib import Path

import mujoco
import numpy as np

# The control rate, which is no setting; and the fingers' speed, of the robot's file.
PERIOD_S = 1 / 240
FINGER_SPEED = 0.05


class Bench:
    """A hand, a table and an object."""

    def __init__(self, xml, settings):
        self.settings = settings
        self.model = model = mujoco.MjModel.from_xml_path(str(xml))
        self.data = mujoco.MjData(model)
        free = [j for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE]
        self.hand_q, self.object_q = (model.jnt_qposadr[j] for j in free)
        self.hand_v, self.object_v = (model.jnt_dofadr[j] for j in free)
        slides = [j for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_SLIDE]
        self.finger_q = [model.jnt_qposadr[j] for j in slides]
        self.finger_v = [model.jnt_dofadr[j] for j in slides]
        self.finger_body = [model.jnt_bodyid[j] for j in slides]
        self.hand_body, self.object_body = (model.jnt_bodyid[j] for j in free)
        self.upper = model.jnt_range[slides[0], 1]
        self.stiffness = model.actuator_gainprm[0, 0]
        self.speed = FINGER_SPEED
        of_body = lambda body: [g for g in range(model.ngeom) if model.geom_bodyid[g] == body]
        self.palm = of_body(self.hand_body)
        self.fixtures = [g for g in of_body(0) if model.geom_type[g] != mujoco.mjtGeom.mjGEOM_PLANE]

    def begin(self, motion, nudge):
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        data.qpos[self.object_q : self.object_q + 7] = motion["object"]
        data.qpos[self.object_q : self.object_q + 3] += nudge
        data.qpos[self.hand_q : self.hand_q + 7] = motion["approach"][0]
        self.target = motion["opening_m"] / 2
        data.qpos[self.finger_q] = self.target
        self.force = None
        self.forces()

    def step(self, now, then):
        """One step of the solver, in which the hand goes from one pose to another."""
        model, data, q, v = self.model, self.data, self.hand_q, self.hand_v
        dt = model.opt.timestep
        data.qpos[q : q + 7] = now
        data.qvel[v : v + 3] = (np.array(then[:3]) - now[:3]) / dt
        turn = np.zeros(3)
        mujoco.mju_subQuat(turn, np.array(then[3:]), np.array(now[3:]))
        data.qvel[v + 3 : v + 6] = turn / dt
        if self.force is None:
            goal = self.target
        else:
            goal = data.qpos[self.finger_q].mean() - self.force / self.stiffness
        self.target += min(max(goal - self.target, -self.speed * dt), self.speed * dt)
        data.ctrl[:] = self.target
        mujoco.mj_step(model, data)

    def forces(self):
        """Net force on the hand; of each finger on the object; whether the object touches anything but what may carry it."""
        model, data = self.model, self.data
        on_hand, fingers, touched = np.zeros(3), [np.zeros(3), np.zeros(3)], False
        may_carry = self.finger_body if self.settings["success"]["fingers_alone"] else [*self.finger_body, self.hand_body]
        ours = {self.hand_body, *self.finger_body}
        wrench = np.zeros(6)
        for i in range(data.ncon):
            contact = data.contact[i]
            bodies = [model.geom_bodyid[g] for g in contact.geom]
            mujoco.mj_contactForce(model, data, i, wrench)
            if wrench[0] <= 0:
                continue
            frame = contact.frame.reshape(3, 3)
            on_second = frame.T @ wrench[:3]
            normal_on_second = frame[0] * wrench[0]
            for me, other, sign in ((bodies[0], bodies[1], -1), (bodies[1], bodies[0], 1)):
                if me in ours and other not in ours:
                    on_hand += sign * on_second
                if me == self.object_body:
                    if other in self.finger_body:
                        fingers[self.finger_body.index(other)] += sign * normal_on_second
                        self.friction = contact.friction[0]
                    touched |= other not in may_carry
        return on_hand, fingers, touched

    def palm_hits(self):
        data, model = self.data, self.model
        return any(
            mujoco.mj_geomDistance(model, data, palm, fixture, 0.0, None) < 0
            for palm in self.palm
            for fixture in self.fixtures
        )

    def hand_from_object(self):
        data = self.data
        place, turn = np.zeros(3), np.zeros(4)
        hand_place, hand_turn = data.qpos[self.hand_q :][:3], data.qpos[self.hand_q + 3 :][:4]
        back = np.zeros(4)
        mujoco.mju_negQuat(back, hand_turn)
        mujoco.mju_rotVecQuat(place, data.qpos[self.object_q :][:3] - hand_place, back)
        mujoco.mju_mulQuat(turn, back, data.qpos[self.object_q + 3 :][:4])
        return place, turn

    def lowest(self):
        model, data = self.model, self.data
        low = math.inf
        for g in range(model.ngeom):
            if model.geom_bodyid[g] == self.object_body:
                centre, half = model.geom_aabb[g, :3], model.geom_aabb[g, 3:]
                turn = data.geom_xmat[g].reshape(3, 3)
                low = min(low, (data.geom_xpos[g] + turn @ centre)[2] - np.abs(turn[2]) @ half)
        return low

    def try_grasp(self, motion, nudge=(0.0, 0.0, 0.0)):
        """What became of the grasp, in the sweep's words."""
        dt = self.model.opt.timestep
        executor, success = self.settings["executor"], self.settings["success"]
        margin = self.settings["physics"]["fingers"]["force_margin"]
        self.begin(motion, np.array(nudge))
        every = round(PERIOD_S / dt)
        for _ in range(round(0.3 / dt)):
            self.step(motion["approach"][0], motion["approach"][0])
        start_lowest = self.lowest()

        # The way to the object, until something is felt.
        way = Follow(motion["approach"], motion["hz"], dt)
        felt_before, pressed, step = self.forces()[0], 0, 0
        felt = lambda: np.linalg.norm(self.forces()[0] - felt_before)
        for now, then in way:
            self.step(now, then)
            step += 1
            if step % every:
                continue
            if self.palm_hits():
                return "collision_on_approach"
            pressed = pressed + 1 if felt() > motion["guard_n"] else 0
            if pressed >= executor["force_periods"]:
                left = np.linalg.norm(np.array(motion["approach"][-1][:3]) - then[:3])
                if left > motion["guard_near_m"]:
                    return "collision_on_approach"
                # Back the way it came until hardly anything presses when the hand stands.
                t = step * dt
                last = max(t - executor["relief_time"], 0.0)
                while t > last and felt() > executor["relief_share"] * motion["guard_n"]:
                    for _ in range(every):
                        now, then = then, way.at(t - executor["back_off_speed"] * dt)
                        t -= executor["back_off_speed"] * dt
                        self.step(now, then)
                    for _ in range(every):
                        self.step(then, then)
                break
        at = then

        # The fingers close until they stand still and press.
        self.force = motion["force_n"]
        self.model.actuator_forcerange[:] = [-margin * self.force, margin * self.force]
        widths, pinched = [], 0
        for step in range(round(executor["grip_timeout"] / dt)):
            self.step(at, at)
            if step % every == 0:
                _, fingers, _ = self.forces()
                pinched = pinched + 1 if self.is_pinched(fingers) else 0
                widths.append(self.data.qpos[self.finger_q].sum())
                pushes = self.stiffness * (self.data.qpos[self.finger_q].mean() - self.target)
                window = 24
                still = len(widths) > window + 1 and abs(widths[-1] - widths[-1 - window]) < executor["still_motion"]
                if still and (pushes > executor["pressed_share"] * self.force or len(widths) > 10 * window):
                    break
        if pinched < round(success["pinch_s"] / PERIOD_S):
            return "missed"

        held_at, width = self.hand_from_object(), widths[-1]
        slip, turned, lifted, clear = 0.0, 0.0, False, 0
        # From where the hand stopped to where the lift begins, and on.
        lift = Follow([at, *motion["lift"]], motion["hz"], dt)
        for phase in (lift, Follow(motion["shake"], motion["hz"], dt)):
            for step, (now, then) in enumerate(phase):
                self.step(now, then)
                if step % every:
                    continue
                if abs(self.data.qpos[self.finger_q].sum() - width) > executor["slip_limit"]:
                    return "slipped_on_lift" if phase is lift else "lost_in_shake"
                _, fingers, touched = self.forces()
                place, turn = self.hand_from_object()
                slip = max(slip, np.linalg.norm(place - held_at[0]))
                gap = np.zeros(3)
                mujoco.mju_subQuat(gap, turn, held_at[1])
                turned = max(turned, math.degrees(np.linalg.norm(gap)))
                free = not touched and self.is_pinched(fingers)
                clear = clear + 1 if free else 0
                lifted |= not touched and self.lowest() - start_lowest >= success["lift_m"]
        if not lifted:
            return "slipped_on_lift"
        if clear < round(success["hold_s"] / PERIOD_S):
            return "lost_in_shake"
        if slip > success["slip_m"] or turned > success["slip_deg"]:
            return "slipped_in_hand"
        return "held"

    def is_pinched(self, fingers):
        success = self.settings["success"]
        a, b = (np.linalg.norm(force) for force in fingers)
        least = success["finger_force_n"]
        if a < least or b < least:
            return False
        opposing = success["opposing_dot"]
        if success["friction_cone"]:
            opposing = min(opposing, -math.cos(2 * math.atan(self.friction)))
        return fingers[0] @ fingers[1] <= opposing * a * b


class Follow:
    """Poses `hz` a second, from one step of `dt` to the next."""

    def __init__(self, poses, hz, dt):
        self.poses = [np.array(pose) for pose in poses]
        for a, b in zip(self.poses, self.poses[1:]):
            if a[3:] @ b[3:] < 0:
                b[3:] *= -1
        self.hz, self.dt = hz, dt

    def at(self, t):
        k = min(int(t * self.hz), len(self.poses) - 1)
        nxt = min(k + 1, len(self.poses) - 1)
        pose = self.poses[k] + (self.poses[nxt] - self.poses[k]) * min(t * self.hz - k, 1.0)
        pose[3:] /= np.linalg.norm(pose[3:])
        return pose

    def __iter__(self):
        steps = max(1, round((len(self.poses) - 1) / self.hz / self.dt))
        now = self.at(0.0)
        for step in range(1, steps + 1):
            then = self.at(step * self.dt)
            yield now, then
            now = then


def one(job):
    folder, settings, line, nudge = job
    name = line["object"]
    if name not in one.benches:
        one.benches[name] = Bench(folder / "mjcf" / f"{name}.xml", settings)
    return one.benches[name].try_grasp(line["motion"], nudge)


one.benches = {}


def agreement(pairs):
    """Share that agrees, and Cohen's kappa."""
    n = len(pairs)
    same = sum(a == b for a, b in pairs) / n
    chance = sum((sum(a == v for a, _ in pairs) / n) * (sum(b == v for _, b in pairs) / n) for v in (True, False))
    return same, (same - chance) / (1 - chance) if chance < 1 else 1.0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sweep", type=Path, help="folder of `grip sweep --motions`")
    parser.add_argument("--limit", type=int, help="only so many grasps of each object, evenly spread")
    parser.add_argument("--jobs", type=int, default=multiprocessing.cpu_count())
    parser.add_argument("--nudge", type=float, default=0.0, metavar="MM", help="shift the object by so much")
    parser.add_argument("--least", type=float, metavar="SHARE", help="fail where fewer agree")
    parser.add_argument("--out", type=Path, help="write both outcomes of each grasp, JSON lines")
    parser.add_argument("--sweep-out", type=Path, metavar="DIR", help="write a sweep with MuJoCo's outcomes, for `grip report`")
    args = parser.parse_args()
    try:
        settings = json.loads((args.sweep / "sweep.json").read_text())["settings"]
        lines = [json.loads(line) for line in (args.sweep / "grasps.jsonl").read_text().splitlines()]
    except OSError as error:
        sys.exit(f"{error}; give the folder of a sweep that was made with --motions")
    lines = [line for line in lines if line.get("motion")]
    if not lines:
        sys.exit(f"{args.sweep}: its grasps have no motions; make the sweep with --motions")
    if args.limit:
        by_object = {}
        for line in lines:
            by_object.setdefault(line["object"], []).append(line)
        lines = [of[i * len(of) // args.limit] for of in by_object.values() for i in range(min(args.limit, len(of)))]
    nudge = (1e-3 * args.nudge, 0.0, 0.0)
    with multiprocessing.Pool(args.jobs) as pool:
        theirs = pool.map(one, [(args.sweep, settings, line, nudge) for line in lines], chunksize=4)
    if args.out:
        rows = [
            json.dumps({k: line[k] for k in ("object", "seed", "case")} | {"ours": line["outcome"], "mujoco": other})
            for line, other in zip(lines, theirs)
        ]
        args.out.write_text("\n".join(rows) + "\n")

    if args.sweep_out:
        args.sweep_out.mkdir(parents=True, exist_ok=True)
        (args.sweep_out / "sweep.json").write_bytes((args.sweep / "sweep.json").read_bytes())
        rows = [{k: v for k, v in line.items() if k != "motion"} | {"outcome": other} for line, other in zip(lines, theirs)]
        (args.sweep_out / "grasps.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))

    print(f"{'object':24}{'grasps':>8}{'both':>7}{'neither':>9}{'ours':>6}{'MuJoCo':>8}{'agree %':>9}{'kappa':>7}")
    for name in [*sorted({line["object"] for line in lines}), None]:
        pairs = [(line["outcome"] == "held", other == "held") for line, other in zip(lines, theirs) if name in (None, line["object"])]
        count, (same, kappa) = Counter(pairs), agreement(pairs)
        print(
            f"{name or 'all':24}{len(pairs):8}{count[True, True]:7}{count[False, False]:9}{count[True, False]:6}"
            f"{count[False, True]:8}{100 * same:9.1f}{kappa:7.2f}"
        )
    for (ours, other), number in Counter((line["outcome"], other) for line, other in zip(lines, theirs)).most_common():
        if (ours == "held") != (other == "held"):
            print(f"  ours {ours}, MuJoCo {other}: {number}")
    if args.least and same < args.least:
        sys.exit(f"fewer than {100 * args.least:.0f} % agree")


if __name__ == "__main__":
    main()
