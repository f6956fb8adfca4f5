"""Arrays of any shape, type and stride: read as what they are, or refused by name; never misread, never a crash."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import grip

SHAPES = arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5)
TYPES = st.one_of(arrays.boolean_dtypes(), arrays.integer_dtypes(), arrays.unsigned_integer_dtypes(), arrays.floating_dtypes(), arrays.complex_number_dtypes())
ANY = TYPES.flatmap(lambda dtype: arrays.arrays(dtype, SHAPES))
K = np.array([[500.0, 0, 2], [0, 500, 1], [0, 0, 1]])
RGB, DEPTH = np.zeros((3, 5, 3), np.uint8), np.ones((3, 5), np.float32)


def error(*arguments, **named) -> str:
    with pytest.raises(grip.Error) as caught:
        grip.Frame(*arguments, **named)
    return str(caught.value)


@settings(max_examples=300, deadline=None)
@given(ANY)
def test_whatever_is_no_colour_picture_is_refused(array):
    if array.dtype == np.uint8 and array.shape == (3, 5, 3):
        return
    assert "rgb" in error(array, DEPTH, K)


@settings(max_examples=300, deadline=None)
@given(ANY)
def test_whatever_is_no_depth_picture_is_refused(array):
    if array.dtype in (np.float32, np.float64) and array.shape == (3, 5) and (array >= 0).all() and np.isfinite(array).all():
        return
    assert "depth" in error(RGB, array, K)


@settings(max_examples=300, deadline=None)
@given(ANY)
def test_whatever_is_no_pose_is_refused(array):
    text = error(RGB, DEPTH, K, world_from_camera=array)
    assert "world_from_camera" in text


@settings(max_examples=100, deadline=None)
@given(arrays.arrays(np.uint8, (3, 5, 3)), st.permutations(range(3)), st.booleans(), st.booleans())
def test_strides_do_not_matter(picture, order, flip, double):
    """The same picture as a view of other memory is the same picture."""
    view = np.transpose(np.ascontiguousarray(np.transpose(picture, order)), np.argsort(order))
    assert (view == picture).all()
    if flip:
        view, picture = view[::-1, ::-1], np.ascontiguousarray(picture[::-1, ::-1])
    depth = np.arange(15, dtype=np.float64 if double else np.float32).reshape(5, 3).T
    frame = grip.Frame(view, depth, K)
    assert (frame.rgb == picture).all() and frame.rgb.flags.c_contiguous
    assert (frame.depth == depth).all() and frame.depth.dtype == np.float32


def test_a_frame_tells_what_is_wrong_with_it():
    assert "divide" in error(RGB, (1000 * DEPTH).astype(np.uint16), K) or "/ 1000" in error(RGB, (1000 * DEPTH).astype(np.uint16), K)
    assert "must be the same" in error(np.zeros((4, 5, 3), np.uint8), DEPTH, K)
    assert "-1" in error(RGB, -DEPTH, K)
    assert "finite" in error(RGB, DEPTH, K * np.nan)
    assert "fx, 0, cx" in error(RGB, DEPTH, np.ones((3, 3)))
    mirrored = np.diag([1.0, 1.0, -1.0, 1.0])
    assert "world_from_camera" in error(RGB, DEPTH, K, mirrored)
    transposed = np.eye(4)
    transposed[3, :3] = 1.0
    assert "last row" in error(RGB, DEPTH, K, transposed)
    assert "no pixels" in error(np.zeros((0, 0, 3), np.uint8), np.zeros((0, 0), np.float32), K)


def test_a_look_is_numpy_and_not_a_copy(frame):
    assert frame.rgb.shape == (480, 640, 3) and frame.rgb.dtype == np.uint8
    assert frame.depth.shape == (480, 640) and frame.depth.dtype == np.float32
    assert frame.rgb is frame.rgb, "the same memory each time"
    assert 0.5 < np.median(frame.depth[frame.depth > 0]) < 2.0, "metres"
    assert np.allclose(frame.world_from_camera[:3, :3] @ frame.world_from_camera[:3, :3].T, np.eye(3))


def test_what_was_written_into_a_frame_counts(scene, frame):
    copy = grip.Frame(frame.rgb, frame.depth, frame.K, frame.world_from_camera)
    estimator = scene.estimator(detector="clusters")
    assert estimator.estimate(copy, [0], seed=3)[0].confidence > 0.5
    copy.depth[:] = 0.0
    with pytest.raises(grip.Error, match="no reading"):
        estimator.estimate(copy, [0], seed=3)
