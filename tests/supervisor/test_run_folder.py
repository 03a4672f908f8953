"""Claims about the folder of a running pipeline: private, locked, found, and cleared up."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

from lodeline.run_folder import (
    AlreadyUpError,
    Key,
    Manifest,
    RunFolder,
    RunFolderError,
    base_folder,
    folder_of,
    marker_of,
    running,
)


@pytest.fixture(autouse=True)
def base(run_base: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("LODELINE_RUN", str(run_base))
    return run_base


def manifest(name: str = "scuttle", *hosts: str) -> Manifest:
    return Manifest(
        name=name,
        hosts=hosts or ("robot",),
        pid=os.getpid(),
        started=1.5,
        file="/p.yaml",
        digest="abc",
        clock="host",
        keys={"scuttle/odom": Key("Odometry", "odometry"), "scuttle/wheels": Key("Wheels", None)},
        nodes={"odometry": "estimation"},
    )


def test_what_runs_is_found_while_it_runs_and_no_longer(base: Path) -> None:
    with RunFolder("scuttle", ["robot"]) as run:
        assert running() == []
        run.publish(manifest())
        (found,) = running()
        assert found.folder == run.path == base / "scuttle" / "robot"
        assert found.manifest == manifest()
        assert running("beego") == []
        assert found.goes_on()
    assert running() == []
    assert not found.goes_on()
    with RunFolder("scuttle", ["robot"]) as run:
        run.publish(manifest())
        assert not found.goes_on()  # it is another run


def test_the_manifest_of_a_dead_run_is_not_believed(base: Path) -> None:
    run = RunFolder("scuttle", ["robot"])
    run.publish(manifest())
    run._unlock()  # as the kernel does when its holder dies
    assert (run.path / "manifest.json").exists()
    assert running() == []


def test_a_second_run_is_refused_and_told_who_and_since_when() -> None:
    with (
        RunFolder("scuttle", ["robot"]),
        pytest.raises(AlreadyUpError, match=rf"ALREADY_UP scuttle@robot: pid {os.getpid()} since "),
    ):
        RunFolder("scuttle", ["robot"])


def test_a_machine_that_plays_all_hosts_keeps_out_each_of_them() -> None:
    with RunFolder("scuttle", ["robot", "laptop"]) as run:
        run.publish(manifest("scuttle", "robot", "laptop"))
        assert [item.manifest.host for item in running()] == ["laptop+robot"]
        with pytest.raises(AlreadyUpError, match="scuttle@laptop"):
            RunFolder("scuttle", ["laptop"])


def test_a_refused_run_leaves_no_lock_behind() -> None:
    with RunFolder("scuttle", ["robot"]), pytest.raises(AlreadyUpError):
        RunFolder("scuttle", ["laptop", "robot"])
    RunFolder("scuttle", ["laptop"]).close()


def test_a_glance_at_the_lock_does_not_make_a_start_fail() -> None:
    with RunFolder("scuttle", ["robot"]) as run:
        lock = run.path.parent / "robot.lock"
    with lock.open() as glance:
        fcntl.flock(glance, fcntl.LOCK_SH)  # as `running` does, though for longer
        away = threading.Timer(0.04, fcntl.flock, (glance, fcntl.LOCK_UN))
        away.start()
        with RunFolder("scuttle", ["robot"]) as run:
            assert run.path.exists()
        away.join()


def test_a_fresh_run_has_no_states_and_a_dead_one_leaves_its_own() -> None:
    with RunFolder("scuttle", ["robot"]) as run:
        state = run.path / "state" / "odometry.msgpack"
        state.write_bytes(b"x")
        (run.path / "hub.sock").touch()
    assert state.exists()
    assert not (run.path / "hub.sock").exists()
    with RunFolder("scuttle", ["robot"]):
        assert not state.exists()


def test_states_of_a_run_that_died_just_now_are_kept_for_the_same_pipeline_and_clock() -> None:
    def dies(age: float = 0.0, digest: str = "0123", epoch: int = 10**18) -> tuple[bool, bool]:
        """Whether the next run resumes, and whether a state is there for it."""
        with RunFolder("scuttle", ["robot"]) as run:
            state = run.path / "state" / "odometry.msgpack"
            state.write_bytes(b"x")
            os.utime(state, times=(time.time() - age,) * 2)
            run.publish(replace(manifest(), digest="0123", epoch=10**18))
            run._unlock()  # as the kernel does when its holder dies
            with RunFolder("scuttle", ["robot"], digest, epoch) as fresh:
                return fresh.resumes, state.exists()

    assert dies() == (True, True)
    assert dies(age=11.0) == (False, False)
    assert dies(digest="4567") == (False, False)
    assert dies(epoch=10**18 + 10**9) == (False, False)  # another boot, or a clock that was set


def test_leftovers_of_a_dead_run_are_killed_and_nobody_else(base: Path) -> None:
    run = RunFolder("scuttle", ["robot"])
    run.publish(manifest())
    run._unlock()
    sleeper = [sys.executable, "-c", "import time; print(1, flush=True); time.sleep(60)"]
    marks = (marker_of(run.path) + "notify0", marker_of(base / "scuttle" / "robot2") + "notify0")
    ours, other = (
        subprocess.Popen(
            sleeper,
            env=os.environ | {"NOTIFY_SOCKET": mark.partition("=")[2]},
            stdout=subprocess.PIPE,
        )
        for mark in marks
    )
    try:
        for process in (ours, other):
            assert process.stdout is not None
            assert process.stdout.readline() == b"1\n"
        with RunFolder("scuttle", ["robot"]) as fresh:
            assert fresh.leftovers == [ours.pid]
        assert ours.wait(2.0) == -9
        assert other.poll() is None
    finally:
        for process in (ours, other):
            process.kill()
            process.communicate()


def test_folders_are_private_whatever_the_umask() -> None:
    before = os.umask(0)
    try:
        with RunFolder("scuttle", ["robot"]) as run:
            for folder in (run.path, run.path.parent, run.path / "state"):
                assert folder.stat().st_mode & 0o777 == 0o700
    finally:
        os.umask(before)


def test_a_folder_that_was_opened_to_others_is_closed_again(base: Path) -> None:
    (base / "scuttle").mkdir(mode=0o777)
    (base / "scuttle").chmod(0o777)
    with RunFolder("scuttle", ["robot"]) as run:
        assert run.path.parent.stat().st_mode & 0o777 == 0o700


def test_a_folder_of_somebody_else_is_refused(base: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (base / "scuttle").mkdir()
    uid = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: uid + 1)
    with pytest.raises(RunFolderError, match=f"belongs to user {uid}: refused"):
        RunFolder("scuttle", ["robot"])


def test_a_link_in_place_of_the_folder_is_refused(base: Path, tmp_path: Path) -> None:
    (base / "scuttle").symlink_to(tmp_path)
    with pytest.raises(RunFolderError, match="is no folder"):
        RunFolder("scuttle", ["robot"])


def test_long_names_still_leave_room_for_a_socket(base: Path) -> None:
    for name, host in (("n" * 60, "robot"), ("scuttle", "h" * 80), ("n" * 60, "h" * 80)):
        path = folder_of(name, [host])
        assert len(str(path)) <= 76
        assert path == folder_of(name, [host])
        assert path != folder_of(name, ["other" + host])
    # The locks of one pipeline lie in one folder, however its hosts are called.
    assert folder_of("n" * 60, ["a"]).parent == folder_of("n" * 60, ["h" * 80]).parent


def test_a_base_too_long_for_sockets_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LODELINE_RUN", "/tmp/" + "x" * 70)
    with pytest.raises(RunFolderError, match="set LODELINE_RUN to a short path"):
        folder_of("scuttle", ["robot"])


def test_the_base_is_the_users_own_runtime_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("LODELINE_RUN")
    monkeypatch.setenv("XDG_RUNTIME_DIR", "/run/user/7")
    assert base_folder() == Path("/run/user/7/lodeline")
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    assert base_folder() == Path(f"/tmp/lodeline-{os.geteuid()}")


def test_a_folder_that_somebody_removed_meanwhile_is_closed_all_the_same(base: Path) -> None:
    with RunFolder("scuttle", ["robot"]) as run:
        shutil.rmtree(run.path)
    with RunFolder("scuttle", ["robot"]) as again:  # the lock was let go
        assert again.path.is_dir()
