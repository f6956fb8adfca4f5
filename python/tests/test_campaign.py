"""Campaigns in process: interrupted and gone on with, wrong, done."""

import hashlib
import os
import signal
import subprocess
import sys
import textwrap

import pytest

import grip

CAMPAIGN = """
[campaign]
name = "here"
units = 2

[trials]
trials = 4
seed = 5
estimators = "truth"
renderer = "cpu"
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_an_interrupted_unit_is_gone_on_with_to_the_same_bytes(tmp_path, monkeypatch):
    # Both are to find what ships with the program in the program.
    monkeypatch.chdir(tmp_path)
    (tmp_path / "campaign.toml").write_text(CAMPAIGN)
    folder = tmp_path / "campaign"
    assert grip.campaign.plan(tmp_path / "campaign.toml", out=folder)["units"][1] == {"first": 7, "items": 2}
    script = f"""
        import os, signal, grip
        # Where shells start things in the background it is ignored.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        here = os.getcwd()
        try:
            grip.campaign.run({str(folder)!r}, unit="0-1", jobs=1)
        except KeyboardInterrupt:
            print("interrupted", os.getcwd() == here)
    """
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(script)], stdout=subprocess.PIPE, text=True)
    while process.poll() is None and not any(path.read_bytes() for path in folder.glob("units/*/trials.jsonl")):
        pass
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=600)
    assert said == "interrupted True\n"
    status = grip.campaign.status(folder)
    assert 1 <= status["have"] < 4 and grip.campaign.missing(folder)[-1] == 1
    with pytest.raises(grip.Error, match="units are not done"):
        grip.campaign.merge(folder, out=tmp_path / "merged")

    assert grip.campaign.run(folder, shard="1/1") and grip.campaign.missing(folder) == []
    assert grip.campaign.run(folder, unit=1), "once more is nothing to do"
    (machine,) = grip.campaign.status(folder)["machines"]
    module = open(grip._grip.__file__, "rb").read()
    assert machine["build_sha256"] == hashlib.sha256(module).hexdigest(), "the program is the module, and not Python's"
    assert grip.campaign.merge(folder, out=tmp_path / "merged")["results"] == 4
    grip.trials(trials=4, seed=5, estimators="truth", renderer="cpu", out=tmp_path / "whole")
    for file in ("trials.jsonl", "items.parquet", "experiment.json"):
        assert (tmp_path / "merged" / file).read_bytes() == (tmp_path / "whole" / file).read_bytes(), file


def test_wrong_campaigns_are_told_as_the_command_tells_them(tmp_path):
    (tmp_path / "campaign.toml").write_text(CAMPAIGN.replace("trials = 4", "trails = 4"))
    with pytest.raises(grip.Error, match="did you mean 'trials'"):
        grip.campaign.plan(tmp_path / "campaign.toml", out=tmp_path / "none")
    assert not (tmp_path / "none").exists()
    with pytest.raises(grip.Error, match="is it the folder of a campaign"):
        grip.campaign.status(tmp_path)
    (tmp_path / "campaign.toml").write_text(CAMPAIGN)
    grip.campaign.plan(tmp_path / "campaign.toml", out=tmp_path / "campaign")
    for wrong, told in [({"unit": 2}, "no unit 2"), ({"unit": "a"}, "0-3,7"), ({}, "which unit"), ({"unit": 0, "shard": "1/1"}, "cannot be used")]:
        with pytest.raises(grip.Error, match=told):
            grip.campaign.run(tmp_path / "campaign", **wrong)
