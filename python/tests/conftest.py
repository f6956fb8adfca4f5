"""What several tests need."""

import pytest

import grip


@pytest.fixture(scope="session")
def scene() -> grip.Scene:
    return grip.Scene(seed=7)


@pytest.fixture(scope="session")
def frame(scene: grip.Scene) -> grip.Frame:
    return scene.world(renderer="cpu").look()
