"""Settings of everything, as ``grip settings`` prints them, with their defaults.

Made of their schema, by ``GRIP_UPDATE_DOCS=1 cargo test --release --lib -- cli:: commands::``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, Optional, Sequence


@dataclass
class TrialBeliefSettings:
    r"""When an estimate is believed."""

    calibration_m: float = 0.0
    r"""How far off the camera may be from where the joints have it, one standard deviation in each direction: its position,
    metres, 0 to 0.1. Default 0. The spread of positions holds it;"""

    calibration_rad: float = 0.0
    r"""and its orientation, radians, 0 to 0.3. Default 0."""

    follow: bool = False
    r"""Whether what was believed at one look is where to look in the next; else each look is as if it were the first.
    Default false."""

    in_view: float = 0.9
    r"""Of an item in the bin at least this share must be within the picture for its estimated pose to be believed; else it
    is where it was put; 0 to 1. Default 0.9."""

    least_confidence: float = 0.25
    r"""Below this confidence an estimate is no target, only an obstacle; 0 to 1. Default 0.25."""

    moved_in_bin_m: float = 0.12
    r"""An item in the bin is not believed to have moved farther than this from where it was put, metres; 0 to 1. Default
    0.12."""

    over_bin_m: float = 0.1
    r"""An estimated centre up to so far above the edge of the bin's walls is in the bin, metres; 0 to 1. Default 0.1."""


@dataclass
class ExecutorSettings:
    r"""Settings of [`super::execute`]."""

    arrival_tolerance: float = 0.005
    r"""Joints this near to their target have arrived, radians or metres, 0.0001 to 1. Default 0.005."""

    back_off_speed: float = 0.5
    r"""Share of the planned speed when backing off, 0.01 to 1. Default 0.5."""

    back_off_time: float = 0.5
    r"""How much of a free motion is taken back after a contact, seconds of the plan, 0 to 60. Default 0.5."""

    early_release: float = 0.05
    r"""A lowering motion that meets something with less than this left lets go there, metres, 0 to 1. Default 0.05: on what
    stands in its way in the bin, rather than to carry it about. The hand then draws back the way it came."""

    farthest_start: float = 0.25
    r"""A motion may begin this far from where the arm is, radians or metres, 0 to 3. Default 0.25: what a guarded motion
    leaves when it stops early."""

    force_periods: int = 2
    r"""Control periods in a row for which a force must last to stop a motion, 1 to 1000. Default 2."""

    free_force: float = 60.0
    r"""Contact force that stops a free motion, newtons beside what was felt at its start, 1 to 1000. Default 60."""

    grip_timeout: float = 3.0
    r"""Longest wait for the fingers, seconds, 0.1 to 60. Default 3.0."""

    miss_share: float = 0.3
    r"""Fingers closer together than this share of the expected width have missed, 0 to 1. Default 0.3."""

    miss_width: float = 0.001
    r"""... or than this, metres, 0 to 0.1. Default 0.001."""

    opening_tolerance: float = 0.001
    r"""Fingers this near to the opening that they were told are open, metres, 1e-6 to 0.1. Default 0.001."""

    pressed_share: float = 0.8
    r"""Share of the commanded force with which the drives must press before a grasp is closed, 0 to 1. Default 0.8: their
    force builds up after the fingers stand still."""

    release_opening: float = 0.03
    r"""How much farther the fingers open for a release in place, metres, both together, 0 to 0.2. Default 0.03: no wider
    than it takes, for there may be a wall beside the hand."""

    release_time: float = 0.8
    r"""How long a release in place takes, seconds, 0 to 60. Default 0.8."""

    relief_share: float = 0.25
    r"""Share of the force that stopped a guarded motion at which the contact is relieved, 0 to 1. Default 0.25."""

    relief_time: float = 0.3
    r"""Most of a guarded motion that is taken back to relieve a contact, seconds of the plan, 0 to 60. Default 0.3."""

    settle_time: float = 0.6
    r"""Longest wait for the joints to arrive after a motion, seconds, 0 to 60. Default 0.6."""

    slip_limit: float = 0.01
    r"""Change of the width while carrying that counts as lost, metres, 0.0001 to 0.2. Default 0.010."""

    still_motion: float = 0.0002
    r"""The fingers stand still when they move less than this in 0.1 s, metres, 1e-6 to 0.1. Default 0.0002."""

    tracking_tolerance: float = 0.05
    r"""Joints farther than this from their target after the wait have failed, radians or metres, 0.0001 to 3. Default 0.05."""


@dataclass
class SupportSettings:
    r"""Settings of [`super::Supports`]. Figures in brackets are the defaults."""

    draws: int = 500
    r"""RANSAC draws, 1 to 100000 (500: with 20 % inliers 500 draws of three points fail once in 55)."""

    enabled: bool = True
    r"""Whether a support plane is looked for at all (true)."""

    higher_area_m2: float = 0.08
    r"""And when it is so large, square metres (0.08): more than the face of any object that a gripper holds. (A cracker box
    that lies near the camera fills as much of the image as the table around it, with 0.034.)"""

    higher_share: float = 0.35
    r"""A plane above the largest one is preferred when it has at least this share of its points, 0 to 1 (0.35): a table
    holds the objects even where more of the floor is in view."""

    inlier_m: float = 0.005
    r"""Points within this distance are the plane's, metres, 0.0001 to 0.1 (0.005: three sigma of a structured-light camera
    at 1 m)."""

    levels_m: float = 0.4
    r"""Other planes that are parallel and as large as that are supports, too, when they are at most so far above or below,
    metres, 0 to 10 (0.4: steps and shelves, but not the floor below a table); 0 for one support alone."""

    max_tilt_rad: float = 0.1
    r"""Largest angle between the plane's normal and the world's up direction as the robot knows it, radians, 0 to pi (0.1:
    support planes are horizontal, and a head camera's tilt is known to a degree or two). With
    [`SupportSettings::ANY_TILT`], pi, `world_from_camera` does not count: for frames that come without one."""

    min_share: float = 0.08
    r"""A plane needs this share of the points that were looked at, 0 to 1 (0.08: less is an object's face)."""

    overhang_m: float = 0.04
    r"""What is beyond the outline of the support by more than this does not stand on it, metres (0.04): objects may
    overhang."""


@dataclass
class ClusterSettings:
    r"""Settings of [`Clusters`]. Figures in brackets are the defaults."""

    jump_m: float = 0.015
    r"""Neighbouring pixels whose depth differs by more belong to different clusters, metres, 0.0001 to 1 (0.015: three
    times the noise at 1 m and a slanted surface)."""

    max_height_m: float = 0.5
    r"""Points higher than this over the plane are no groceries, metres, 0.01 to 10 (0.5)."""

    min_height_m: float = 0.008
    r"""Points up to this height over the plane are the plane's, metres, 0 to 1 (0.008): over the noise at 1 m, under the
    marker's 18 mm."""

    min_pixels: int = 30
    r"""Clusters with fewer pixels are noise, 1 or more (30): 30 pixels are 3 cm² at 1 m."""

    reach_px: int = 3
    r"""Pixels this far apart are neighbours still, 1 to 100 (3): thin holes do not split a cluster."""

    support: SupportSettings = field(default_factory=SupportSettings)
    r"""How the support plane is found; switched off, everything with a reading may be an object's."""


@dataclass
class PyramidSettings:
    r"""Settings of [`super::PyramidCnn`]. Figures in brackets are the defaults."""

    coarsest_share: float = 0.75
    r"""Levels end where a box would be longer than this share of the image's longer side, 0.01 to 1 (0.75)."""

    finest_side_px: float = 56.6
    r"""Longer side of the boxes of the pyramid's finest level, pixels of the image, 8 to 1000 (56.6): few objects are
    smaller, and one more level would cost as much as all others together."""

    octaves: float = 0.5
    r"""From one level to the next, octaves of scale, 0.1 to 4 (0.5)."""

    reach_cells: int = 2
    r"""Cells to each side over which a position is averaged, 0 to 16 (2): an object's centre is in the middle of the cells
    that respond."""

    same_box_iou: float = 0.5
    r"""Boxes of one object that overlap by more are one and the same, of which the most confident stays: intersection over
    union, 0 to 1 (0.5)."""


@dataclass
class DetectorSettings:
    r"""Settings of the detectors, each by its name."""

    clusters: ClusterSettings = field(default_factory=ClusterSettings)
    r"""Of depth clusters on the support plane."""

    pyramid: PyramidSettings = field(default_factory=PyramidSettings)
    r"""Of the network's image pyramid."""


@dataclass
class BeliefSettings:
    r"""What scores are worth as probabilities. Figures in brackets are the defaults."""

    presence_scale: float = 0.04
    r"""Scale of the logistic function about it, over 0 (0.04)."""

    presence_score: float = 0.5
    r"""Score at which an object is as likely present as absent, -10 to 10 (0.5)."""

    temperature: float = 0.012
    r"""Temperature of the places' masses, over 0 (0.012): with it the best place has as much mass as it is right."""


@dataclass
class ColourSettings:
    r"""When colour may decide between poses that depth cannot tell apart. Figures in brackets are the defaults."""

    depth_margin: float = 0.1
    r"""A pose whose depth score, after polishing, is lower than that of the present one by more is no equal of it, whatever
    its print, 0 to 1 (0.1)."""

    enabled: bool = True
    r"""Whether it may (true; the paper: not). Switched off, poses are left as depth has them."""

    finalists: int = 4
    r"""Winners that geometry may refuse before colour gives up, 1 to 1000 (4): each costs a polish."""

    margin: float = 0.02
    r"""By how much score and weighted agreement of a pose must be better together than those of the present one, 0 to 1
    (0.02)."""

    min_agreement: float = 0.1
    r"""How well the print at a pose must agree with the picture, -1 to 1 (0.1: with noise it does nearly as well)."""

    min_pixels: int = 60
    r"""Pixels below which nothing is decided, 10 or more (60); an object has 1000 to 4000 at the resolution at which it is
    compared."""

    most_modes: int = 6
    r"""Poses of the population that are looked at besides the symmetric ones, 0 to 1000 (6): more would be noise of the
    search."""

    most_shift_px: float = 6.0
    r"""The print of an object and its shape, colour and depth image are so many pixels apart at most, 0 to 8 (6)."""

    noise_m: float = 0.001
    r"""Errors of depth at which its score counts for half, metres, over 0 (0.001): what does not average out within a
    [window](crate::UncertaintySettings) is 0.1 mm in our own scenes, 0.7 in hard ones."""

    revolution_steps: int = 24
    r"""Coarse turns about the axis of a body of revolution, 4 to 360 (24); the best are refined."""

    same_mode_rad: float = 0.35
    r"""Two of these are one when they are turned against each other by less, radians, 0 to pi (0.35)."""

    weight: float = 0.35
    r"""What an agreement with the picture of 1 (see [`ColourVerdict::agreement`](crate::ColourVerdict::agreement)) is
    worth, in units of the depth score, 0 to 10 (0.35)."""


@dataclass
class JointSettings:
    r"""How objects are looked at together, after each was searched on its own. Figures of scores, which are about 0 to 1,
    unless said; those in brackets are the defaults."""

    afloat_m: float = 0.015
    r"""Farther from the support plane and from all other objects than this is in the air, metres, 0 to 10 (0.015)."""

    afloat_weight: float = 0.03
    r"""What hanging in the air costs, 0 to 10 (0.03)."""

    alternatives: int = 12
    r"""Poses of the population that are looked at, besides the best, 0 to 100000 (12)."""

    claim_kernel: float = 2.0
    r"""A pixel is explained when the surfaces are this many epsilons apart at most, 0.1 to 100 (2)."""

    conflict_share: float = 0.5
    r"""Two objects that explain the same pixels, by more than this share of either one's inliers, are in conflict: the one
    with the lower score is searched again without those pixels. 0 to 1 (0.5)."""

    enabled: bool = True
    r"""Whether they are (true; the paper: not)."""

    instances: int = 1
    r"""Instances of each object that are looked for, at most, 0 to 1000 (1); those after the first are further modes of the
    posterior. (The paper finds one, and names that as its limit.)"""

    margin: float = 0.05
    r"""A pose that scores less than the best one by more is no alternative to it, 0 to 10 (0.05)."""

    overlap_free_m: float = 0.006
    r"""Overlap that is free, metres, 0 to 10 (0.006): of estimates that are a little off, and of simplified meshes;"""

    overlap_full_m: float = 0.02
    r"""and that costs the full weight (0.02)."""

    overlap_weight: float = 0.1
    r"""What an overlap of bodies costs, at most, 0 to 10 (0.1)."""


@dataclass
class NearSymmetrySettings:
    r"""How a result is compared with itself, turned so that it nearly lies on itself: boxes, clamps, mugs, whose scores
    differ little then. Figures in brackets are the defaults."""

    apart_rad: float = 0.6
    r"""Of those turned against each other by less than this, radians, 0 to pi (0.6), one is polished,"""

    enabled: bool = True
    r"""Whether it is (true)."""

    explained_weight: float = 0.3
    r"""What explaining twice as many pixels of the image is worth among these, in units of the score, 0 or more (0.3)."""

    finalists: int = 4
    r"""and so many of all, 1 to 1000 (4)."""

    kernel: float = 3.0
    r"""and this kernel, in epsilons, over 0 (3),"""

    margin: float = 0.1
    r"""A turned one that scores less than the result by more is not looked at further, 0 or more (0.1)."""

    steps: int = 2
    r"""by so many Gauss-Newton steps, 0 to 1000 (2)."""

    stride: Literal[1, 2, 4, 8] = 2
    r"""The resolution at which they are pulled into place and compared: 1, 2, 4 or 8 (2),"""

    triangles: int = 200
    r"""with a model of this many triangles, 4 to 100000 (200),"""


@dataclass
class ObservationSettings:
    r"""Settings of [`super::Observation`]. Figures in brackets are the defaults."""

    block_spread_m: float = 0.015
    r"""Readings of a block of pixels that are farther from each other belong to two surfaces, metres, 0.0001 to 1 (0.015)."""

    edge_jump_m: float = 0.01
    r"""Depth jumps larger than this between neighbouring readings are edges, metres, 0.0001 to 1 (0.010: thrice the noise
    at 1 m)."""

    edge_reach_px: int = 12
    r"""Depth edges are looked for across holes of up to this many pixels, 1 to 1000 (12: the projector's shadow of a near
    object)."""

    edge_sigma_px: float = 1.5
    r"""Standard deviation of the distance from a silhouette to a depth edge, pixels of the level's resolution, 0.1 to 100
    (1.5)."""

    edge_slope_m: float = 0.002
    r"""A wide hole may hide a slope: each pixel of it adds this to the jump that makes an edge, metres, 0 to 1 (0.002)."""

    epsilon_m: float = 0.007
    r"""A rendered point this far from the observed one is no inlier, metres, 0.0001 to 0.1 (0.007; the paper: 0.005). On
    synthetic depth 0.005 is best by a little; real depth is off by up to 8 mm at the true pose, and 0.008 is best
    there."""

    plane_band_m: float = 0.003
    r"""Points lower than 0.4 times this over the support plane explain nothing, those higher than 1.4 times fully, metres,
    0.0001 to 0.1 (0.003: the noise of the plane)."""

    support: SupportSettings = field(default_factory=SupportSettings)
    r"""How the support plane is found; switched off, all points may be an object's."""


@dataclass
class PolishSettings:
    r"""The polish of the best hypotheses at full resolution, whose scores are final. Figures in brackets are the defaults."""

    converged_m: float = 0.0001
    r"""A step that moves no point of the object farther is the last, metres, 0 to 0.1 (0.0001): a tenth of what the noise
    leaves."""

    finalists: int = 2
    r"""Hypotheses of the last level that are polished, 1 to 1000 (2)."""

    kernel: float = 1.0
    r"""Kernel of the final score, in epsilons, over 0 (1): final scores are compared between restarts and with other
    objects'."""

    steps: int = 8
    r"""Gauss-Newton steps, 0 to 1000 (8)."""

    triangles: int = 1000
    r"""Triangles of the mesh that final scores are made with, 4 to 100000 (1000)."""


@dataclass
class ProposalSettings:
    r"""How the first hypotheses are drawn from boxes. Figures in brackets are the defaults."""

    anywhere: float = 0.1
    r"""Least share of proposals that are drawn from the whole image and not from boxes, 0 to 1 (0.1; the paper: 0). Where
    the best box is doubtful, it is what that box lacks to certainty: a detector that darkness fools is no hindrance
    then. The least share is for detectors that are sure and wrong; it gains nothing with ours."""

    centre_scatter: float = 0.15
    r"""Scatter about a box's centre, as a share of its sides, 0 to 1 (0.15); half of the proposals are drawn so, the others
    through an observed point."""

    miss_weight: float = 0.02
    r"""Weight of a proposal whose projection misses its box altogether; one that fills it has 1 more. Over 0, to 1 (0.02)."""

    oversampling: int = 8
    r"""Proposals drawn for each that is kept by the overlap of its projection with its box, 1 to 1000 (8)."""

    resting_share: float = 0.5
    r"""Share of proposals in resting orientations on the support plane, 0 to 1 (0.5); the others are uniform over all
    rotations, so that leaning and stacked objects are found too. No plane, no resting proposals."""

    tilt_rad: float = 0.03
    r"""Tilt of resting proposals, standard deviation about each axis, radians, 0 to 1 (0.03): supports and models are not
    exact."""

    vague_share: float = 0.5
    r"""A box that covers more of the image than this share says nothing about extent, and its overlap does not count, 0 to
    1 (0.5)."""


@dataclass
class RestartSettings:
    r"""When a search is made anew, and when it ends. Figures in brackets are the defaults."""

    hopeless_after: int = 3
    r"""Restarts after which a search may be given up, 1 to 1000 (3)."""

    hopeless_score: float = 0.3
    r"""When the best of [`RestartSettings::hopeless_after`] restarts scores less, the object is not there: no more
    restarts, and no second search (0.3: a true pose scores over 0.5 nearly always)."""

    most: int = 8
    r"""Restarts end when the best score was reached twice at the same place, or after this many, 1 to 1000 (8)."""

    same_hull_m: float = 0.015
    r"""and their convex hulls by less (Hausdorff distance), metres (0.015)."""

    same_position_m: float = 0.006
    r"""their origins by less, metres (0.006),"""

    same_score: float = 0.03
    r"""Two restarts agree when their scores differ by less (0.03),"""

    sure_score: float = 0.75
    r"""A restart that scores this much needs no other one to agree (0.75). Of 120 first restarts in a data set of our own
    that scored 0.7 or more, 119 were within 1 cm."""


@dataclass
class ScoreSettings:
    r"""What counts in a score, and how much. Figures in brackets are the defaults; the score is divided by the sum of the
    first three weights."""

    box_weight: float = 0.3
    r"""Weight of a box's confidence times overlap, 0 or more (0.3; the paper: alpha_box + alpha_b = 0.2). Exact boxes
    deserve 0.6, sloppy ones 0.1."""

    edge_weight: float = 0.4
    r"""Weight of the silhouette term, 0 or more (0.4; the paper: alpha_e, in another form)."""

    fit_weight: float = 0.6
    r"""Weight of the depth fit, over 0 (0.6; the paper: alpha_r)."""

    min_pixels: float = 60.0
    r"""A hypothesis that covers fewer full-resolution pixels is rejected, 0 or more (60): slivers fit anything."""

    min_visible: float = 0.15
    r"""The denominator is at least this share of the rendered pixels, over 0, to 1 (0.15)."""

    occlusion_discount: float = 0.7
    r"""Share of occluded pixels that is taken out of the denominator, 0 to 1 (0.7): below 1, since what hides behind others
    explains nothing."""

    penetration_free_m: float = 0.012
    r"""Penetration of the plane up to this is free, metres, 0 to 1 (0.012): real models sink by up to 12 mm under the
    fitted plane."""

    penetration_full_m: float = 0.02
    r"""Penetration beyond that which costs the full weight, metres, over 0, to 1 (0.02)."""

    plane_weight: float = 0.3
    r"""Weight of the penetration of the support plane, 0 or more (0.3)."""

    violation: float = 0.5
    r"""What a pixel costs where the camera looks through the hypothesis, as a share of what an inlier gains, 0 or more
    (0.5)."""


@dataclass
class SearchLevel:
    r"""One level of the search, coarse to fine: `samples` hypotheses, each moved by Gauss-Newton steps and weighed."""

    diffusion_m: Sequence[float]
    r"""Standard deviation of the diffusion after the first and the last round, metres, 0 to 10, interpolated geometrically.
    No diffusion follows the last round of a level."""

    diffusion_rad: Sequence[float]
    r"""The same for rotation, radians, 0 to 10."""

    iterations: int
    r"""Rounds of move, weigh, resample and diffuse, 1 to 1000."""

    kernel: float
    r"""Half-width of the soft inlier kernel, in units of [`ObservationSettings::epsilon_m`](crate::ObservationSettings),
    0.1 to 100."""

    samples: int
    r"""Hypotheses that live in this level, 1 to 100000."""

    steps: int
    r"""Gauss-Newton steps of each hypothesis in each iteration, 0 to 1000."""

    stride: Literal[1, 2, 4, 8]
    r"""Pixel blocks of this side make one pixel: 1, 2, 4 or 8; less for an object that would be fewer than
    [`SearchSettings::least_side_px`] of these across."""

    triangles: int
    r"""Triangles of the simplified model that is rendered, 4 to 100000."""


@dataclass
class SearchSettings:
    r"""One pass of the search, from the first hypotheses to the last level. Figures in brackets are the defaults."""

    damping: float = 0.01
    r"""Damping of Gauss-Newton, relative to the diagonal of the normal equations, over 0 (0.01)."""

    ess: float = 0.3
    r"""Effective sample size after tempering, as a share of the samples, over 0, to 1 (0.3)."""

    last_ess: float = 0.5
    r"""The same in the last level (0.5)."""

    least_side_px: float = 20.0
    r"""How many pixels of a level an object must be across, 0 to 1000 (20); see [`SearchLevel::stride`]."""

    levels: Sequence[SearchLevel] = field(default_factory=lambda: [SearchLevel(diffusion_m=[0.0, 0.0], diffusion_rad=[0.0, 0.0], iterations=1, kernel=5.0, samples=400, steps=2, stride=8, triangles=60), SearchLevel(diffusion_m=[0.0, 0.0], diffusion_rad=[0.0, 0.0], iterations=1, kernel=5.0, samples=150, steps=3, stride=8, triangles=60), SearchLevel(diffusion_m=[0.01, 0.005], diffusion_rad=[0.2, 0.1], iterations=2, kernel=3.0, samples=50, steps=2, stride=4, triangles=200), SearchLevel(diffusion_m=[0.004, 0.002], diffusion_rad=[0.1, 0.05], iterations=2, kernel=2.0, samples=20, steps=1, stride=2, triangles=200)])
    r"""Coarse to fine (400 samples at stride 8, 150 at 8, 50 at 4, 20 at 2; the paper: 625 samples, 400 iterations at one
    resolution)."""


@dataclass
class TrackSettings:
    r"""How the last posterior is the prior of the next frame. Figures in brackets are the defaults."""

    least_confidence: float = 0.5
    r"""An object is followed while it is believed to be there with this confidence, 0 to 1 (0.5),"""

    least_mass: float = 0.001
    r"""Modes with less mass are not followed, 0 to 1 (0.001)."""

    memory: int = 20
    r"""Frames that follow each other err alike: masses are by the mean of the evidence of so many of them, 1 to 100000
    (20), and never surer than that of one."""

    most_drop: float = 0.05
    r"""and explains the frame no worse than the last one by more of the score, 0 to 10 (0.05). Else it is searched for."""

    motion_m: float = 0.01
    r"""Standard deviation of what an object moves by between two frames, in each direction, metres, 0 to 1 (0.01),"""

    motion_rad: float = 0.03
    r"""and turns by, as the camera sees it, radians, 0 to 3 (0.03)."""

    samples: int = 24
    r"""Hypotheses of each mode, 1 to 1000 (24): its pose, and others about it; half of them at each finer level."""

    search_again: int = 10
    r"""After so many frames it is searched for in any case, beside where it is believed to be, 1 to 100000 (10)."""


@dataclass
class UncertaintySettings:
    r"""What the covariance of a pose is made of, beside what the depth image itself says. Figures in brackets are the
    defaults."""

    degrees_of_freedom: float = 4.5
    r"""Degrees of freedom of the t distribution, over 2 (4.5): how large errors are is known from few cells alone."""

    edge_px: float = 2.0
    r"""To what the silhouette is known, pixels of the picture, 0.1 to 100 (2)."""

    inflation: float = 1.3
    r"""Standard deviations are larger than errors of depth explain by this factor, over 0 (1.3)."""

    least_noise_m: float = 0.0001
    r"""Errors of depth that are no smaller, metres, over 0 (0.0001)."""

    most_places: int = 6
    r"""Modes besides the best one that are looked at, 0 to 100 (6)."""

    particles: int = 64
    r"""Poses that are drawn of all modes together, 1 to 10000 (64)."""

    prior_m: float = 0.02
    r"""How far off a pose can be at all: its position, metres, over 0 (0.02),"""

    prior_rad: float = 1.0
    r"""and its orientation, radians, over 0 (1)."""

    slow_m: Sequence[float] = field(default_factory=lambda: [0.00082, 0.00015, 0.00037])
    r"""The camera's slow errors, which an object as a whole shares and does not show, metres at 1 m, 0 to 1 each: along the
    ray, growing with the square of the distance; across it, growing with the distance; and of turns, by which the
    object's rim is moved (0.00082, 0.00015, 0.00037: the `carmine-109`; for another camera in proportion)."""


@dataclass
class GripSettings:
    r"""Settings of [`GripEstimator`](crate::GripEstimator), a part for each step, in the order of the steps. Figures in
    brackets are the defaults, and the paper's where it has the quantity."""

    belief: BeliefSettings = field(default_factory=BeliefSettings)
    r"""What scores are worth as probabilities."""

    colour: ColourSettings = field(default_factory=ColourSettings)
    r"""When colour decides."""

    joint: JointSettings = field(default_factory=JointSettings)
    r"""How objects are looked at together."""

    near_symmetry: NearSymmetrySettings = field(default_factory=NearSymmetrySettings)
    r"""How the result is compared with its near-symmetric poses."""

    observation: ObservationSettings = field(default_factory=ObservationSettings)
    r"""How a frame is prepared: tolerances, edges, the support plane."""

    polish: PolishSettings = field(default_factory=PolishSettings)
    r"""How the last of them are polished."""

    proposal: ProposalSettings = field(default_factory=ProposalSettings)
    r"""How the first hypotheses are drawn."""

    restarts: RestartSettings = field(default_factory=RestartSettings)
    r"""When the search is made anew."""

    score: ScoreSettings = field(default_factory=ScoreSettings)
    r"""What counts in the score of a hypothesis."""

    search: SearchSettings = field(default_factory=SearchSettings)
    r"""How they are moved, weighed and drawn again, coarse to fine."""

    track: TrackSettings = field(default_factory=TrackSettings)
    r"""How objects are followed from frame to frame."""

    uncertainty: UncertaintySettings = field(default_factory=UncertaintySettings)
    r"""How far off poses may be."""


@dataclass
class PaperSettings:
    r"""Settings of [`PaperEstimator`](crate::PaperEstimator). The default is the published method, read literally; section
    and equation numbers are those of Chen et al. 2019."""

    alpha_b: float = 0.1
    r"""inliers in the box,"""

    alpha_box: float = 0.1
    r"""Weights of the terms of W (alpha: 0.1, 0.1, 0.3, 0.25, 0.25): confidence of the box,"""

    alpha_e: float = 0.25
    r"""edge inliers,"""

    alpha_p: float = 0.25
    r"""planar inliers."""

    alpha_r: float = 0.3
    r"""all inliers,"""

    box_jump: float = 1.0
    r"""OPEN in the paper: the chance, each iteration, that a sample's box is drawn anew among all boxes ("diffused
    uniformly within the image")."""

    centre: Literal["anywhere", "image", "box"] = "anywhere"
    r"""Where a sample's centre must be, or it weighs nothing (anywhere)."""

    converged: float = 0.9
    r"""Weight of the best sample at which iterations end (w-bar: 0.9)."""

    decay_by: Literal["current", "running"] = "current"
    r"""OPEN in the paper: whose weight the diffusion shrinks by."""

    decay_exponent: int = 5
    r"""and the exponent of its decay (5)."""

    decay_from: float = 0.6
    r"""Weight of the best sample at which the diffusion begins to shrink (0.6),"""

    diffusion: Literal["axes", "length"] = "axes"
    r"""OPEN in the paper: what has the diffusion's standard deviations."""

    edge_ln_c: float = -5.5
    r"""Logarithm of the smoothness from which a point is an edge (-5.5)."""

    epsilon_m: float = 0.005
    r"""Inlier distance, metres (epsilon: 0.005)."""

    feature_match: Literal["pixel", "near"] = "pixel"
    r"""OPEN in the paper: which of them a hypothesis's feature may match."""

    holes: Literal["skip", "origin"] = "skip"
    r"""OPEN in the paper: neighbours without a point."""

    iterations: int = 400
    r"""Most iterations (Implementation: 400)."""

    keep_best: bool = False
    r"""Whether the best sample survives as it is (false)."""

    limit_observed: bool = True
    r"""OPEN in the paper: whether the limits hold for the observation's features too, or only for a hypothesis's."""

    min_pixels: int = 0
    r"""Samples that cover fewer pixels of the image weigh nothing (0)."""

    neighbours: int = 2
    r"""OPEN in the paper: half the side of the neighbourhood N of a point, pixels."""

    ranking: Literal["smoothness", "scan"] = "smoothness"
    r"""OPEN in the paper: which points of a window come first."""

    resampling_exponent: float = 1.0
    r"""Samples are drawn in proportion to W to this power (1)."""

    samples: int = 625
    r"""Samples an object (Implementation: 625)."""

    sigma_m: float = 0.07
    r"""Standard deviations of the diffusion at the start, metres (sigma_T: 0.07)"""

    sigma_rad: float = 0.3
    r"""and radians (sigma_R: 0.3)."""

    start: Literal["frustum", "readings"] = "frustum"
    r"""OPEN in the paper: where samples begin."""

    stride: Literal[1, 2, 4, 8] = 1
    r"""OPEN in the paper: at what part of the image's resolution hypotheses are rendered and compared. ("The sample size is
    limited by the buffer size"; epsilon is "approximated distance between adjacent points", which at 0.8 m is 6 mm at a
    quarter of 640 x 480.)"""

    support: SupportSettings = field(default_factory=lambda: SupportSettings(enabled=False))
    r"""With a support plane, points on it are nobody's inliers (switched off)."""

    triangles: int = 500
    r"""Triangles of the model that is rendered; their depth is off by 0.1 to 0.6 mm on average, a tenth of epsilon."""

    window: int = 5
    r"""Side of the windows in which features are limited, pixels (5)."""

    window_edges: int = 5
    r"""Most edge points a window (5)."""

    window_planes: int = 2
    r"""Most planar points a window (2)."""


@dataclass
class PerceptionSettings:
    r"""Settings of all detectors and estimators: the perception part of a settings file. What a file leaves out has its
    default. ``` let settings: grip_perception::PerceptionSettings = toml::from_str( "[grip.restarts] most = 1
    [grip.colour] enabled = false", )?; assert_eq!((settings.grip.restarts.most, settings.grip.polish.steps), (1, 8));
    assert!(settings.validate().is_ok()); # Ok::<(), toml::de::Error>(()) ```"""

    detector: DetectorSettings = field(default_factory=DetectorSettings)
    r"""The first stage."""

    grip: GripSettings = field(default_factory=GripSettings)
    r"""The second stage."""

    paper: PaperSettings = field(default_factory=PaperSettings)
    r"""The second stage as published."""

    paper_guarded: PaperSettings = field(default_factory=lambda: PaperSettings(box_jump=0.0, centre="box", keep_best=True, min_pixels=40, resampling_exponent=4.0, support=SupportSettings()))
    r"""The same with guards that the paper leaves out ([`PaperSettings::guarded`])."""


@dataclass
class FingerSettings:
    r"""The two fingers: dynamic bodies on force-limited drives."""

    damping: float = 200.0
    r"""Damping of a drive, N s/m, 0 to 1e5. Default 200."""

    edge_m: float = 0.001
    r"""Radius of the edges of the fingers, metres, 0 to 0.01. Default 0.001: it makes contacts of grasps a matter of
    distances, which are exact, and not of penetration depths. For boxes that touch by some micrometres parry 0.31 now
    and then takes another side for the nearest, which was a blow of 400 N on one grasp of a bottle in eight."""

    force_margin: float = 3.0
    r"""A drive may push this many times harder than it was told to, 1 to 100. Default 3: the spring between target and
    finger sets the force, this only bounds it."""

    inertia: float = 0.0002
    r"""Its moment of inertia about each axis, kg m^2, 1e-8 to 1. Default 0.0002 (a zero would make NaN)."""

    mass_kg: float = 0.25
    r"""Mass of a finger with its drive, kg, 0.001 to 10. Default 0.25."""

    opening_force_n: float = 60.0
    r"""Force with which an opening drive may push, newtons, 1 to 1000. Default 60."""

    pad_friction: float = 0.9
    r"""Coulomb friction of the pads as it is, whatever planning believes, 0 to 2. Default 0.9, rubber. With an object's own
    the pair has their mean."""

    stiffness: float = 20000.0
    r"""Stiffness of a drive, N/m, 1 to 1e6. Default 20000."""

    torsion_m: float = 0.004
    r"""Arm of the torsional friction of the patch in which a pad touches a point or an edge, metres, 0 to 0.05. Default
    0.004: rubber of 2 MPa on a curve of 30 mm under 40 N touches it in a patch of radius 7 mm (Hertz), whose arm is 3
    pi / 16 of that."""


@dataclass
class LayoutSettings:
    r"""The coarser world of [`World::for_layout`](crate::World::for_layout): a third of the steps a second, a fraction of
    the work in each, and air as thick as oil, in which what rolls and tips comes to rest where it would anyway, but
    soon."""

    angular_damping: float = 8.0
    r"""Damping of the angular velocity, 1/s, 0 to 100. Default 8."""

    contact_recycle_m: float = 0.005
    r"""As [`SolverSettings::contact_recycle_m`], metres, 0 to 0.1. Default 0.005."""

    iterations: int = 2
    r"""Iterations of the constraint solver a step, 1 to 100. Default 2."""

    linear_damping: float = 2.0
    r"""Damping of the velocity, 1/s, 0 to 100. Default 2."""

    sleep_s: float = 0.15
    r"""What has been at rest for so long sleeps, seconds, 0 to 10. Default 0.15: it costs nothing from then on."""


@dataclass
class ObjectSettings:
    r"""What resists the motion of objects, and how hard they are struck."""

    angular_damping: float = 0.5
    r"""Damping of the angular velocity, 1/s, 0 to 100. Default 0.5."""

    blow_steps: int = 5
    r"""Steps of 1/240 s over which the impulse of a blow is summed up, 1 to 240. Default 5 (21 ms): a stiff contact spreads
    it over some."""

    calm_speed: float = 0.002
    r"""Nothing moves as long as no point of any object is faster than this, m/s, above 0 to 1. Default 0.002."""

    floor_friction: float = 0.6
    r"""Coulomb friction of the floor, 0 to 2. Default 0.6."""

    linear_damping: float = 0.0
    r"""Damping of the velocity, 1/s, 0 to 100. Default 0: free fall."""

    rolling_resistance: float = 0.02
    r"""Coefficient of rolling resistance, 0 to 1: the lever arm of the resisting torque as a share of the object's size.
    Default 0.02: rigid cans on wood come to rest within about a second, as real ones do; rapier itself knows no rolling
    resistance."""


@dataclass
class PlacementSettings:
    r"""How objects are put on the table before a trial."""

    attempts: int = 40
    r"""Layouts tried before the scene is called infeasible, 1 to 10000. Default 40."""

    bin_gap_m: float = 0.06
    r"""Outlines keep this far from the bin, metres, 0 to 0.5. Default 0.06: an open hand fits between."""

    clutter_distance: Sequence[float] = field(default_factory=lambda: [0.1, 0.7])
    r"""An object of a cluttered layout is dropped at least and at most this far from another one, as a share of the sum of
    their outlines' radii, each 0 to 2. Default 0.1 to 0.7."""

    draws: int = 20
    r"""Ways to spread the objects drawn in each of them, 1 to 10000. Default 20."""

    drift_m: float = 0.001
    r"""What moves less than this is at rest, metres, above 0 to 0.1. Default 0.001. (Not by speed: solids of many pieces
    tremble in the solver's hands.)"""

    drop_m: float = 0.004
    r"""Height above what is below it from which an object is dropped, metres, 0.0001 to 0.5. Default 0.004: enough to be
    free of the table, too little to bounce."""

    edge_m: float = 0.03
    r"""A dropped object must come to rest this far inside the table's edge, metres, 0 to 0.5. Default 0.03."""

    fall_s: float = 0.8
    r"""Time for what is put down to come to rest before the next one follows, seconds, above 0 to 60. Default 0.8."""

    fallen_s: float = 0.2
    r"""It must be at rest for as long as this, seconds, above 0 to 60. Default 0.2."""

    falls: int = 6
    r"""Falls tried for an object of a cluttered layout before the layout is given up, 1 to 1000. Default 6."""

    places: int = 400
    r"""Places tried for an object that is spread, 1 to 100000. Default 400."""

    rolling_m: float = 0.015
    r"""What moves farther than this in `fallen_s` is about to roll away, metres, above 0 to 1. Default 0.015."""

    settle_s: float = 4.0
    r"""Time for the whole layout to come to rest, seconds, above 0 to 60. Default 4."""

    stands_s: float = 0.5
    r"""It must be at rest for as long as this, seconds, above 0 to 60. Default 0.5."""

    starts: int = 10
    r"""Places that each fall may begin from, 1 to 1000. Default 10."""


@dataclass
class ServoSettings:
    r"""The servos of the joints that are not fingers."""

    acceleration: float = 2.5
    r"""The servos may accelerate this much harder than plans are allowed to, 1 to 10. Default 2.5, so that they can follow
    a plan and still brake."""

    bandwidth: float = 60.0
    r"""Bandwidth, 1/s, 1 to 240: how fast a position error decays when no limit is active. Default 60."""

    give: float = 1.0
    r"""How far they give way under what presses on the hand, times what the robot's file says (`[stiffness]`), 0 to 100.
    Default 1."""

    give_s: float = 0.1
    r"""Time constant with which they give way, seconds, 0.02 to 10. Default 0.1: the arm's inertia, and slow enough beside
    contacts that do not give."""

    link_friction: float = 0.5
    r"""Coulomb friction of the links against objects, 0 to 2. Default 0.5, painted plastic."""


@dataclass
class SolverSettings:
    r"""How rapier solves contacts. Measured on eleven grasps (close, lift 0.3 m, hold 3 s, shake): with rapier's defaults 8
    of 11 hold and foam is pressed in by 31 mm; with these 11 of 11, creep at most 0.02 mm."""

    contact_damping: float = 5.0
    r"""Damping ratio of both, 0.1 to 100. Default 5."""

    contact_hz: float = 120.0
    r"""Natural frequency of contacts between bodies that move, Hz, 1 to 1000. Default 120."""

    contact_recycle_m: float = 0.001
    r"""Drift up to which the points of a contact are kept, metres, 0 to 0.1. Default 0.001: more than that saves no
    measurable time."""

    iterations: int = 8
    r"""Iterations of the constraint solver a step, 1 to 100. Default 8."""

    prediction_m: float = 0.005
    r"""Distance within which contacts are foreseen, metres, 0 to 0.1. Default 0.005: fewer such contacts are the main
    saving with many hulls."""

    static_contact_hz: float = 25.0
    r"""Natural frequency of contacts with what is fixed, Hz, 1 to 1000. Default 25: guards, blows and servos were measured
    with it. The built-in objects, let fall upright ten times each, come to rest at 25, 60 and 240 Hz alike, and sink
    into the table by at most 0.55, 0.11 and 0.01 mm."""

    steps: int = 1
    r"""Steps of the engine in each control step of 1/240 s, 1 to 16. Default 1. More are finer and slower; of grasps under
    pose errors 2 or 4 of them change two in a hundred (docs/results.md)."""


@dataclass
class StopSettings:
    r"""The protective stop of the arm."""

    deeper_m: float = 0.003
    r"""After a collision stop the arm may move on unless it goes deeper by this much, metres, 0 to 0.1. Default 0.003."""

    force_n: float = 80.0
    r"""Normal force on a link that is no finger that trips it, newtons, 1 to 1e4. Default 80, of the order of what joint
    torque supervision of a Fetch-sized arm notices."""

    grace_steps: int = 180
    r"""Steps after a stop was cleared during which force does not stop the arm again, so that it can back out, 0 to 2400.
    Default 180."""

    steps: int = 12
    r"""Steps of 1/240 s in a row for which it must last, 1 to 240. Default 12: such supervision is filtered, and a guarded
    motion gets to react first."""


@dataclass
class PhysicsSettings:
    r"""Settings of a [`World`](crate::World), and of how objects are laid out in it."""

    fingers: FingerSettings = field(default_factory=FingerSettings)
    r"""The two fingers and their drives."""

    layout: LayoutSettings = field(default_factory=LayoutSettings)
    r"""The coarser world in which data sets lay objects out."""

    objects: ObjectSettings = field(default_factory=ObjectSettings)
    r"""What resists the motion of objects, and how hard they are struck."""

    placement: PlacementSettings = field(default_factory=PlacementSettings)
    r"""How objects are put on the table before a trial."""

    servo: ServoSettings = field(default_factory=ServoSettings)
    r"""The servos of the robot's joints."""

    solver: SolverSettings = field(default_factory=SolverSettings)
    r"""How the engine solves contacts."""

    stop: StopSettings = field(default_factory=StopSettings)
    r"""When the arm stops by itself."""


@dataclass
class GivenMargins:
    r"""Margins of which some are given: the others are those of their place."""

    own: Optional[float] = None
    r""""""

    spread: Optional[float] = None
    r""""""

    world: Optional[float] = None
    r""""""


@dataclass
class AntipodalSettings:
    r"""Settings of [`super::antipodal_grasps`]."""

    approaches: int = 16
    r"""Approach directions about each closing axis, 1 to 360. Default 16, so that 0, 90, 180 degrees are among them."""

    depths: Sequence[float] = field(default_factory=lambda: [0.0, 0.012, 0.022])
    r"""How far behind the contact the centres of the pads may be, metres, 0 to 0.2: shallow grasps reach flat objects on a
    table. Default 0, 12 and 22 mm; the pads' half length is 30 mm."""

    finger_room: float = 0.024
    r"""Air between open fingers and the object in tight places, both sides together, metres, 0 to 0.2. Default 0.024."""

    friction_share: float = 0.6
    r"""Share of the friction coefficient that the normals may use up, 0.01 to 1. Default 0.6."""

    hand_room: float = 0.001
    r"""Distance of the open hand from the object that it is about to grasp, metres, 0 to 0.05. Default 0.001."""

    max_width: float = 0.092
    r"""Widest object, metres, 0.001 to 1. Default 0.092: the Fetch's opening of 0.10 less 4 mm on each side."""

    overshoot: float = 0.005
    r"""How much farther along the fingers the hand must fit as well, metres, 0 to 0.1: pose error and servo lag may push it
    on. Default 0.005."""

    pad_friction: float = 0.9
    r"""Coefficient of friction of the pads, 0 to 5; a pad and an object have the mean of theirs. Default 0.9: rubber, and
    what the simulated pads have. Physics and planner should agree on it."""

    pairs: int = 160
    r"""Most contact pairs kept, spread over the object, 1 to 100 000. Default 160."""

    samples: int = 1000
    r"""Surface points drawn, 1 to 1 000 000. Default 1000."""


@dataclass
class GraspWeights:
    r"""Weights of a grasp's score, each 0 to 100. Each term is between 0 (bad) and 1 (good)."""

    clearance: float = 0.6
    r"""Distance of the hand from other things ([`GraspSettings::clearance_full`]). Default 0.6."""

    cone: float = 0.4
    r"""Normals along the closing axis. Default 0.4."""

    contact: float = 1.0
    r"""Contact patch ([`GraspSettings::contact_full`]). Default 1.0."""

    depth: float = 0.5
    r"""Contacts at the pads' centre rather than at their tips. Default 0.5."""

    gravity: float = 1.0
    r"""Approach straight down, or level and away from the robot where the hand comes from the front. Default 1.0: the arm
    and the bin's walls favour the one, a board above the object the other."""

    lever: float = 1.2
    r"""Centre of mass between the pads ([`GraspSettings::lever_scale`]). Default 1.2: a lever lets the object turn."""

    room: float = 1.0
    r"""Room between pads and object against two standard deviations of the position. Default 1.0."""

    spread: float = 2.0
    r"""Contacts that spread in both directions ([`GraspSettings::spread_full`]): about a line, such as a can's rim, an
    object turns in the hand. Default 2.0, which outweighs the lever of a can's corner."""


@dataclass
class GraspSettings:
    r"""Settings of [`super::rank_grasps`]."""

    antipodal: AntipodalSettings = field(default_factory=AntipodalSettings)
    r"""Candidates in the object's frame."""

    clearance_full: float = 0.03
    r"""Distance of the hand from other things at which its term is full, metres, 0.001 to 1. Default 0.03."""

    contact_full: float = 0.34
    r"""Share of the pads in contact at which its term is full, 0.01 to 1. Default 0.34: a third of the pad is what a can
    gives."""

    distinct_angle: float = 0.21
    r"""... and turned by less than this, radians, 0 to pi. Default 0.21, 12 degrees."""

    distinct_distance: float = 0.008
    r"""Grasps nearer to each other than this are one, metres, 0 to 0.1, ... Default 0.008: if one is out of reach, so is
    the other."""

    fingertips: float = 0.003
    r"""What of the pads must stay on the object when a grasp that reaches too low is drawn back, metres, 0 to 0.1. Default
    0.003."""

    firm: float = 4.5
    r"""A grasp of this score is worth taking before others are picked away, 0 to 1000. Default 4.5, of 7.7 that weights
    give at most: of 60 grasps in clutter three of four that slipped were below it and two of 56 that held."""

    front_least_away: float = 0.0
    r"""Where no grasp from above leads to a plan and a board is above the object, the hand comes from the front: least part
    of the approach direction that leads level away from the robot's base, -1 to 1. Default 0: from the front or from
    beside, not from behind."""

    front_least_down: float = -0.1
    r"""Least downward part of the approach direction of such a hand, -1 to 1. Default -0.1: level, by an estimate that is
    turned a little."""

    keep: int = 40
    r"""Grasps returned at most, 1 to 100 000. Default 40."""

    least_down: float = 0.17
    r"""Least downward part of the approach direction, -1 to 1. Default 0.17: up to 80 degrees from straight down."""

    lever_scale: float = 0.06
    r"""Horizontal distance of the centre of mass from the pads at which its term is zero, metres, 0.001 to 1. Default 0.06."""

    margin: float = 0.004
    r"""Least distance of the hand from the table and other things at the grasp, metres, 0 to 0.1. Default 0.004."""

    most_tried: int = 1500
    r"""Grasps that are tried with the hand's solids at most, 1 to 1 000 000: a bound on the work in hopeless clutter.
    Default 1500."""

    spread_full: float = 0.003
    r"""Spread of the contacts (one standard deviation) at which its term is full, metres, 0.0001 to 0.1. Default 0.003."""

    spread_share: float = 0.5
    r"""Share of the other objects' position spread that is added to that, 0 to 10. Default 0.5."""

    standoff: float = 0.09
    r"""Distance of the pre-grasp pose along the approach, metres, 0.01 to 0.5. Default 0.09."""

    weights: GraspWeights = field(default_factory=GraspWeights)
    r"""Weights of the score."""


@dataclass
class GraspTestSettings:
    r"""The test of a single grasp: close, lift, shake."""

    lift: float = 0.12
    r"""Height of the lift, metres, 0.01 to 1. Default 0.12."""

    shake: float = 0.03
    r"""How far the hand is moved from side to side, along the world's x, y and z, metres, 0.001 to 0.3. Default 0.03."""

    shake_speed: float = 0.5
    r"""How fast at most, m/s, 0.001 to 5. Default 0.5; the joints' limits for carrying bound the acceleration, as on the
    way to the bin."""


@dataclass
class GripForceSettings:
    r"""Settings of [`grip_force`]."""

    delicate_least: float = 20.0
    r"""Least force on a delicate object, newtons, 0 to 1000. Default 20."""

    delicate_share: float = 0.7
    r"""Share of the gripper's largest force that a delicate object bears, 0 to 1. Default 0.7."""

    fragile_least: float = 10.0
    r"""Least force on a fragile object, newtons, 0 to 1000. Default 10."""

    fragile_share: float = 0.4
    r"""Share of the gripper's largest force that a fragile object bears, 0 to 1. Default 0.4."""

    lever_scale: float = 0.02
    r"""Distance of the centre of mass from the pads at which the force is doubled, metres, 0.001 to 1. Default 0.02."""

    load: float = 1.3
    r"""What the contacts carry, multiples of the object's weight, 1 to 10. Default 1.3: weight and acceleration."""

    safety: float = 4.0
    r"""Safety factor on that, 1 to 100. Default 4."""

    sturdy_least: float = 30.0
    r"""Least force on a sturdy object, newtons, 0 to 1000. Default 30."""


@dataclass
class LiftSettings:
    r"""Straight lifts after a grasp."""

    heights: Sequence[float] = field(default_factory=lambda: [0.2, 0.15, 0.25, 0.1])
    r"""Heights tried, metres, best first, each 0.01 to 1. Default 0.20, 0.15, 0.25, 0.10."""

    lean: float = 0.5
    r"""How far a lift leans to one side where none straight up is free, radians, 0 to 1.4. Default 0.5."""

    lean_directions: int = 8
    r"""Directions tried for a lift that leans, 0 to 360. Default 8."""

    leaving: float = 0.03
    r"""Height over which a lifted object may still touch what it touched when it lay, metres, 0 to 0.5. Default 0.03:
    estimates overlap."""

    low: float = 0.04
    r"""Height straight up that is tried last under a board, metres, 0.01 to 1. Default 0.04: the way on leads back out."""


@dataclass
class OrderSettings:
    r"""Settings of [`pick_order`]."""

    crowd_gap: float = 0.04
    r"""Neighbours nearer than this are in the hand's way, metres, 0 to 1. Default 0.04."""

    lean: float = 0.1
    r"""Tilted by more than this from where it would stand, an object leans, radians, 0 to pi. Default 0.1."""

    lean_gap: float = 0.01
    r"""What leans and is nearer than this to something leans on it, metres, 0 to 1. Default 0.01."""


@dataclass
class PlaceSettings:
    r"""Settings of [`super::place_poses`]."""

    cell: float = 0.005
    r"""Edge of a cell of the height map, metres, 0.001 to 0.05. Default 0.005."""

    distinct_angle: float = 0.5
    r"""... and with headings that differ by less than this, radians, 0 to pi. Default 0.5."""

    distinct_distance: float = 0.025
    r"""Places nearer to each other than this are one, metres, 0 to 1, ... Default 0.025."""

    headings: int = 24
    r"""Headings tried over a full turn, 1 to 360. Default 24."""

    height_cost: float = 2.0
    r"""Cost of a metre of the object's top above the bin's floor, litres, 0 to 1000. Default 2: it breaks ties, low ones
    first."""

    keep: int = 400
    r"""Places returned at most, 1 to 100 000. Default 400: the hand fits only at some of them."""

    margin: float = 0.008
    r"""Room about the object's outline to walls and neighbours, metres, 0 to 0.1. Default 0.008; the spread of the object's
    position is added."""

    middle_cost: float = 0.1
    r"""Cost of the middle of the bin against its walls, litres, 0 to 1000. Default 0.1: the middle stays open for the hand."""

    release_height: float = 0.008
    r"""Height above the support at which the object is let go, metres, 0 to 0.2. Default 0.008."""

    stand_margin: float = 0.015
    r"""Where an object stands, what bears it reaches so far beyond its centre of mass to every side, metres, 0 to 0.1, or
    half as far as the object does. Default 0.015: less than that and it falls off a bottle's cap."""

    support_gap: float = 0.006
    r"""A gap below the object that is smaller than this counts as support, metres, 0 to 0.05. Default 0.006: about a cell."""

    tip_cost: float = 100.0
    r"""Cost of a place where the object tips over, litres, 0 to 1e6. Default 100: more than of any where it stands."""

    tip_fall: float = 0.04
    r"""How deep what is below an object may be where it tips over, metres, 0 to 1. Default 0.04: it would fall as far."""


@dataclass
class PushSettings:
    r"""Settings of [`Planner::plan_push`]."""

    directions: int = 12
    r"""Directions that are tried, 1 to 64. Default 12."""

    edge: float = 0.05
    r"""What is pushed must end so far from the bin's walls and the table's edge, metres, 0 to 0.5. Default 0.05."""

    force: float = 40.0
    r"""Force at which the hand stops, newtons, 1 to 1000. Default 40: five items of half a kilogram slide by 15."""

    height: float = 0.03
    r"""How high above what the object stands on the finger tips are at most, metres, 0.005 to 0.2. Default 0.03: low, so
    that it slides and does not fall over."""

    length: float = 0.08
    r"""How far an object is pushed, metres, 0.01 to 0.5. Default 0.08: about the width of what stood beside it."""

    rise: float = 0.15
    r"""How far up the hand comes down from and goes again, metres, 0.01 to 0.5. Default 0.15."""

    room: float = 0.02
    r"""Room between the closed fingers and the object before, metres, 0 to 0.2. Default 0.02."""


@dataclass
class RrtSettings:
    r"""Settings of [`rrt_connect`] and [`shortcut`]."""

    max_iterations: int = 1500
    r"""Give up after this many extensions, 1 to 10 000 000. Default 1500: what is found at all is found by then, as a rule."""

    short_step: float = 0.25
    r"""Edge that is tried where that is blocked, metres, 0.001 to 10. Default 0.25."""

    shortcuts: int = 60
    r"""Shortcut attempts on a path that was found, 0 to 100 000. Default 60."""

    step: float = 1.0
    r"""Longest edge, metres of [`JointSpace::distance`], 0.01 to 10. Default 1.0: some five edges across the work space."""


@dataclass
class SpeedSettings:
    r"""How fast the arm moves."""

    acceleration_share: float = 0.8
    r"""Share of the joints' acceleration limits that is used, 0.01 to 1. Default 0.8."""

    corner: float = 0.15
    r"""Largest distance of a rounded corner from the path, norm of joint values, 0 to 2. Default 0.15."""

    dt: float = 0.004166666666666667
    r"""Time between trajectory points, seconds, 0.0001 to 0.1. Default 1/240, the control period."""

    guarded: float = 0.08
    r"""Speed of the gripper when it may touch something, m/s, 0.001 to 2. Default 0.08."""

    holding_share: float = 0.8
    r"""Share of those while an object is held, 0.01 to 1. Default 0.8."""

    ramp_s: float = 0.05
    r"""Accelerations build up over this time, seconds, 0 to 0.5. Default 0.05: the jerk of a joint is at most twice its
    acceleration by that, as for a controller that is not shaken; motions last as much longer."""

    straight: float = 0.25
    r"""Speed of the gripper in other straight motions, m/s, 0.001 to 2. Default 0.25."""

    velocity_share: float = 0.9
    r"""Share of the joints' velocity limits that is used, 0.01 to 1. Default 0.9."""


@dataclass
class UnmodelledSettings:
    r"""Settings of [`unmodelled_obstacles`]."""

    cell: float = 0.01
    r"""Edge of the cells that readings are gathered in, metres, 0.002 to 0.01. Default 0.01; no larger, since a cell's
    obstacle is a ball of 6 mm, and balls a centimetre apart leave no gap."""

    fixture: float = 0.015
    r"""... to a fixture. Default 0.015, beyond the noise of depth at a metre."""

    height: float = 0.5
    r"""How high above the table anything is looked at, metres, 0.01 to 10. Default 0.5."""

    object: float = 0.02
    r"""A reading this near to a believed object is one of it, metres, 0 to 0.2, beside the object's own spread. Default
    0.02."""

    reach: float = 1.3
    r"""How far from the base, seen from above, anything is looked at, metres, 0.1 to 10. Default 1.3, the arm's reach."""

    readings: int = 6
    r"""Readings that a cell needs, 1 to 100 000: single ones at the edges of objects are mixtures of what is before and
    behind. Default 6."""

    robot: float = 0.03
    r"""... to the robot. Default 0.03."""


@dataclass
class PlannerSettings:
    r"""Settings of [`crate::Planner`]."""

    carry_tries: int = 3
    r"""Paths to places that are searched for each grasp, 1 to 1000. Default 3: what blocks three of them blocks more."""

    free_margins: GivenMargins = field(default_factory=lambda: GivenMargins(own=0.005, spread=0.5, world=0.01))
    r"""Margins of free motion. Default 10 mm to the world, so that checks 20 mm apart leave no gap; 5 mm between links;
    half of an object's spread."""

    grasp: GraspSettings = field(default_factory=GraspSettings)
    r"""Choice of grasps."""

    grasp_test: GraspTestSettings = field(default_factory=GraspTestSettings)
    r"""Tests of single grasps, which packing does not use."""

    grasp_tries: int = 24
    r"""Grasps that are tried, best first, 1 to 100 000. Default 24."""

    grip_force: GripForceSettings = field(default_factory=GripForceSettings)
    r"""How firmly to hold."""

    guard_force: float = 20.0
    r"""Contact force that stops a guarded motion, newtons, 1 to 1000. Default 20."""

    guard_near: float = 0.02
    r"""A guarded motion that stops with less than this left has arrived, metres, 0 to 0.2. Default 0.02."""

    ik_seeds: int = 8
    r"""Seeds from the table for each inverse kinematics problem, 0 to 6000. Default 8."""

    ik_solutions: int = 3
    r"""Solutions of the inverse kinematics that are tried for each grasp, 1 to 1000. Default 3."""

    least_lower: float = 0.08
    r"""Straight way from above down to a place, metres, at least, 0.01 to 1. Default 0.08."""

    lift: LiftSettings = field(default_factory=LiftSettings)
    r"""Straight lifts."""

    near_margins: GivenMargins = field(default_factory=lambda: GivenMargins(own=0.003, spread=0.0, world=0.002))
    r"""Margins of straight motion at objects. Default 2 mm to the world, 3 mm between links and nothing of the spread: the
    hand has to come near what it grasps."""

    order: OrderSettings = field(default_factory=OrderSettings)
    r"""Which object to pick first."""

    place: PlaceSettings = field(default_factory=PlaceSettings)
    r"""Choice of places."""

    place_tries: int = 16
    r"""Places that are tried for each of them, of those that the hand fits in, 1 to 100 000. Default 16."""

    push: PushSettings = field(default_factory=PushSettings)
    r"""Pushing what is too crowded to be picked."""

    release_opening: float = 0.03
    r"""How much wider than the object the gripper opens to let go, metres, both sides together, 0.001 to 0.2. Default
    0.030."""

    retreat: float = 0.1
    r"""Straight way back from a placed object, metres, 0.01 to 1. Default 0.10."""

    rrt: RrtSettings = field(default_factory=RrtSettings)
    r"""Search in joint space."""

    shake: float = 0.0
    r"""How far what is held is moved from side to side above its place before it is lowered, along the world's x, y and z,
    metres, 0 to 0.3. Default 0: not at all. Its speed is `grasp_test.shake_speed`."""

    speed: SpeedSettings = field(default_factory=SpeedSettings)
    r"""Speeds and accelerations."""

    table_snap: float = 0.015
    r"""Objects whose lower side is within this of the table's height are believed to stand on it, metres, 0 to 0.1. Default
    0.015: a table's height is known far better than an object's."""

    unmodelled: UnmodelledSettings = field(default_factory=UnmodelledSettings)
    r"""Obstacles of the depth image."""

    wall_clearance: float = 0.03
    r"""Room between the object and the top of the bin's walls when it is carried in, metres, 0 to 0.5. Default 0.03."""

    way_out_length: float = 0.3
    r"""Length of that way at most, metres, 0.02 to 1. Default 0.3."""

    way_out_near: float = 0.05
    r"""Where something is nearer than this, a search begins with a straight way out, metres, 0 to 0.5. Default 0.05:
    searches hardly find out of a shelf by themselves."""


@dataclass
class TrialScoreSettings:
    r"""Bounds of the score card. None of them decides whether an item was packed."""

    cell_m: float = 0.005
    r"""Edge of a cell of the height map by which density is measured, metres; 0.001 to 0.05. Default 0.005."""

    disturbed_m: float = 0.01
    r"""An item is disturbed when a point of it moved farther than this during an attempt at another, metres; 0 to 1.
    Default 0.01."""

    resting_n: float = 0.2
    r"""Something rests on an item that it presses down with at least this, newtons; 0 to 50. Default 0.2: what leans on it
    or touches it from the side does not."""


@dataclass
class Carmine109:
    r"""Settings of the Carmine 1.09 model."""

    bias_px: float = 0.06
    r"""Standard deviation of the smooth error of disparity, pixels, 0 to 10. Default 0.06."""

    grazing_exponent: int = 8
    r"""Exponent n of the drop-out probability (1 - cos)^n, 0 to 100; 0 for no drop-out. Default 8."""

    lateral_px: float = 0.5
    r"""Standard deviation of the sideways shift of each pixel, pixels, 0 to 10. Default 0.5."""

    projector_x: float = 0.075
    r"""Where the projector stands beside the infrared camera along its x axis, metres, -1 to 1; 0 for no projector shadow.
    Default 0.075: on the right, so that shadows fall to the left of things."""


@dataclass
class ColorSensor:
    r"""A colour sensor behind its lens."""

    electrons_per_nit_second: float = 2560.0
    r"""Electrons a pixel gathers in one second from 1 cd/m^2, 1 to 1e6. The default, 2560: f/2 lens of 90 % transmission
    (0.177 lux on the chip), 2.8 um pixels, 45 % quantum efficiency, 4.1e15 photons in a lumen second."""

    full_well: float = 6000.0
    r"""Electrons at which a pixel is full, 100 to 1e6. Default 6000, usual for pixels of this size."""

    levels: float = 1023.0
    r"""Steps of the analogue-digital converter, after gain, 255 to 65535. Default 1023 (10 bits)."""

    read_noise: float = 4.0
    r"""Read-out noise, electrons (standard deviation), 0 to 1000. Default 4."""

    spread: float = 0.1
    r"""Share of a pixel's light that lens and demosaicing spread to each of its two neighbours along rows, and along
    columns, 0 to 0.33. Default 0.1, a point spread of 0.45 px (standard deviation)."""

    target: float = 0.18
    r"""Mean signal that auto exposure aims at, as a share of full scale, 0.01 to 0.9. Default 0.18, photography's middle
    grey."""

    white_balance: float = 0.85
    r"""Share of the light's colour that white balance removes: 1 makes white paper white, 0 leaves it. Default 0.85."""


@dataclass
class SensorSettings:
    r"""Settings of the sensors that a scene may name."""

    carmine: Carmine109 = field(default_factory=Carmine109)
    r"""Depth of the presets `carmine-109` and `carmine-109-near`."""

    color: ColorSensor = field(default_factory=ColorSensor)
    r"""Colour."""


@dataclass
class SuccessCriteria:
    r"""The bounds by which a grasp and a packed item are judged. `pack --strict` prints them beside what was measured; the
    clauses that they belong to are those of [`crate::score::outcome::Clauses`]."""

    at_rest_m_s: float = 0.01
    r"""Slower than this it is at rest, m/s; 0 to 1. Default 0.01."""

    fallen_m: float = 0.05
    r"""An item is lost when its lowest point is so far below the table's top, metres; 0 to 1. Default 0.05."""

    finger_force_n: float = 1.0
    r"""A finger presses from this force on, newtons; 0.1 to 50. Default 1: well above the solver's noise, well below the 5
    N of the weakest grasp."""

    fingers_alone: bool = True
    r"""Whether an item is lifted clear and held only while no link of the robot touches it but the fingers. Default yes:
    what the palm carries is not held."""

    friction_cone: bool = True
    r"""Whether fingers must also oppose each other as friction demands (antipodal, Nguyen 1988): forces within its cone
    balance only where the normals are at most twice its angle off a line, with the true friction of pads and item.
    Default yes."""

    hold_s: float = 0.1
    r"""How long the item must have been pinched and clear of everything when the carry ends, seconds; 0 to 5. Default 0.1."""

    landing_m_s: float = 1.0
    r"""How fast it may be when it has been let go, m/s; 0 to 10. Default 1: after a fall of 5 cm."""

    lift_m: float = 0.03
    r"""How far the lowest point must rise while nothing but the hand touches the item, metres; 0 to 0.5. Default 0.03, as
    usual for grasps on a bench."""

    opposing_dot: float = -0.3
    r"""Fingers oppose each other when the dot product of their unit forces is at most this; -1 to 0. Default -0.3: forces
    107 degrees apart or more."""

    pinch_s: float = 0.025
    r"""How long they must press before the lift begins, seconds; 0 to 1. Default 0.025: six steps of physics."""

    release_m: float = 0.05
    r"""How far it may fall when it is let go, metres; 0 to 1. Default 0.05: a person who packs sets down and does not drop."""

    rest_m: float = 0.002
    r"""It is at rest when no point of it moves farther than this in the trial's last second (`trial.drift_s`), metres; 0 to
    1. Default 0.002: what solids of many pieces tremble in the solver's hands stays well below, what rolls or tips does
    not."""

    slip_deg: float = 20.0
    r"""How far it may turn in the hand, degrees; 0 to 180. Default 20."""

    slip_m: float = 0.02
    r"""How far it may move in the hand, metres; 0 to 0.2. Default 0.02: one that moved more was dragged along."""

    tilt_deg: float = 30.0
    r"""An item that must stand may lean this far, degrees; 0 to 90. Default 30."""

    unharmed: bool = True
    r"""Whether an item that took a larger blow than does it no harm (`scenes/objects.toml`, fragility) from the attempt
    that packed it on is not packed. Default yes. (What befell it on the table before, the score card counts.)"""


@dataclass
class SweepSettings:
    r"""Numbers of a sweep that are no part of its question."""

    layouts: int = 30
    r"""Layouts of a seed that are tried until one has a grasp within reach; 1 to 1000. Default 30."""

    thrown_m: float = 0.003
    r"""How far the object may move meanwhile, metres; 0 to 0.1. Default 0.003: a hand that begins inside it throws it."""

    wait_s: float = 0.15
    r"""Simulated seconds before the approach; 0 to 10. Default 0.15."""


@dataclass
class TrialSettings:
    r"""How a trial goes, whoever perceives and plans."""

    calm_s: float = 2.0
    r"""Simulated seconds after an attempt for what still rolls to come to rest; 0 to 60. Default 2."""

    drift_s: float = 1.0
    r"""Simulated seconds after that in which nothing should move any more; 0 to 60. Default 1."""

    estimator_timeout_s: float = 60.0
    r"""How long an estimator of others may take for an answer, seconds, and five times as long for its first one; 0.01 to
    3600. Default 60. After that the trial ends with `estimator_failed`."""

    final_settle_s: float = 8.0
    r"""Simulated seconds at the end of the trial for everything to come to rest; 0 to 60. Default 8."""

    grasper_timeout_s: float = 60.0
    r"""The same for a grasp planner of others: after that the trial ends with `grasper_failed`; 0.01 to 3600. Default 60."""

    max_attempts: int = 3
    r"""An item is given up after this many attempts; 1 to 100. Default 3."""

    max_fruitless_looks: int = 2
    r"""Looks in a row after which nothing could be planned end the trial; 1 to 100. Default 2."""

    max_pushes: int = 3
    r"""How often the robot pushes what is in a trial, where nothing can be picked; 0 to 100. Default 3."""

    max_put_aside: int = 1
    r"""How often an item is put aside on the table in a trial, because it cannot be packed as it lies without a risk; 0 to
    100. Default 1."""

    second_look_mass: float = 0.0
    r"""When an item may lie in a second way, with at least this share of the belief, the robot looks from elsewhere before
    it plans; 0 to 0.5. Default 0: never."""

    second_look_torso_m: float = 0.1
    r"""How high the torso is there, metres over its lower stop; 0 to 1. Default 0.1. The head looks at that item; what the
    camera no longer sees stays where it was believed to be."""


@dataclass
class Settings:
    r"""Everything that decides results and is no input of its own (scene, condition, objects, robot, seed)."""

    belief: TrialBeliefSettings = field(default_factory=TrialBeliefSettings)
    r"""When an estimate is believed."""

    executor: ExecutorSettings = field(default_factory=ExecutorSettings)
    r"""How plans are carried out."""

    perception: PerceptionSettings = field(default_factory=PerceptionSettings)
    r"""Detectors and estimators."""

    physics: PhysicsSettings = field(default_factory=PhysicsSettings)
    r"""The physics world."""

    planner: PlannerSettings = field(default_factory=PlannerSettings)
    r"""Choice of grasps and places, and motion planning."""

    score: TrialScoreSettings = field(default_factory=TrialScoreSettings)
    r"""Bounds of the score card."""

    sensor: SensorSettings = field(default_factory=SensorSettings)
    r"""The camera's sensors."""

    success: SuccessCriteria = field(default_factory=SuccessCriteria)
    r"""What counts as a success."""

    sweep: SweepSettings = field(default_factory=SweepSettings)
    r"""Grasps under known pose errors."""

    trial: TrialSettings = field(default_factory=TrialSettings)
    r"""How a trial goes."""
