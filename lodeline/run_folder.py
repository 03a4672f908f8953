"""Where a running pipeline keeps its sockets and states, and how tools find out what runs.

`BASE/NAME/HOST`, where BASE is LODELINE_RUN, else `$XDG_RUNTIME_DIR/lodeline`, else
`/tmp/lodeline-UID`. Whoever holds the lock file beside the folder is the pipeline's supervisor;
the kernel frees the lock when it dies, in whatever way.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import shutil
import stat
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from lodeline.supervisor.guard import kill_marked

VARIABLE = "LODELINE_RUN"
MANIFEST = "manifest.json"
STATE = "state"
MAX_PATH = 76
"""Bytes of a run folder's path: 31 are left for a socket's name (sun_path holds 107)."""
LOCK_PATIENCE_S = 0.1
RESUME_S = 10.0
"""States that are older are of a robot that may stand elsewhere by now."""
SAME_CLOCK_NS = 100_000_000


class RunFolderError(RuntimeError):
    """The folder cannot be had, or cannot be trusted."""


class AlreadyUpError(RunFolderError):
    """Another supervisor runs this pipeline on this host."""


@dataclass(frozen=True, slots=True)
class Key:
    """What is known of a key: its message class, and the node that sends it (None: external)."""

    type: str
    node: str | None


@dataclass(frozen=True, slots=True)
class Reader:
    """A node that reads a key: how many samples may wait for it, and how old they may be [s]."""

    node: str
    queue: int
    max_age: float | None


@dataclass(frozen=True, slots=True)
class Manifest:
    """What runs in a run folder. `started` [s] is UNIX time, `overrides` are those of the pipeline.

    `nodes` gives each node of the whole pipeline its process, `places` its host; only those on
    `hosts` run here. `readers` are the nodes of all hosts that read a key, by key; `withheld` what
    the link does not take from tools here to nodes of another host: `@restart`, `cmd_vel`.
    `sources` are the files that it was read from, see `lodeline.pipeline.edited`. `epoch` [ns] is
    that of its clock, another after a boot or when the clock was set.
    """

    name: str
    hosts: tuple[str, ...]
    pid: int
    started: float
    file: str
    digest: str
    clock: str
    keys: dict[str, Key]
    nodes: dict[str, str]
    readers: dict[str, tuple[Reader, ...]] = field(default_factory=dict)
    places: dict[str, str] = field(default_factory=dict)
    withheld: tuple[str, ...] = ()
    overrides: tuple[str, ...] = ()
    sources: dict[str, str] = field(default_factory=dict)
    epoch: int = 0

    @property
    def host(self) -> str:
        """The hosts whose nodes run here, as one word: `robot`, or `laptop+robot`."""
        return host_word(self.hosts)

    def refusal(self, order: str, node: str) -> str | None:
        """Why an order to a node would not reach it from here, and what mends that."""
        place = self.places.get(node)
        if place is None or place in self.hosts or f"@{order}" not in self.withheld:
            return None
        return (
            f"{node} is on {place}, and tools on {self.host} may not {order} over tls: "
            + self._remedy(order)
        )

    def unheard(self, key: str) -> str | None:
        """Why no reader would get what a tool here sends on a full key, and what mends that."""
        short = key.removeprefix(f"{self.name}/")
        places = {self.places.get(reader.node) for reader in self.readers.get(key, ())}
        if short not in self.withheld or not places or places & {None, *self.hosts}:
            return None
        return f"tools on {self.host} may not send {short} over tls: {self._remedy(short)}"

    def _remedy(self, word: str) -> str:
        return f"write `grant: [{word}]` for {self.host} in the pipeline file of both"


@dataclass(frozen=True, slots=True)
class Running:
    """A pipeline that runs on this machine now; `written` [ns] is when its manifest was."""

    folder: Path
    manifest: Manifest
    written: int

    def goes_on(self) -> bool:
        """Whether it still runs, under the same supervisor: a look that reads no file."""
        try:
            same = (self.folder / MANIFEST).stat().st_mtime_ns == self.written
        except OSError:
            return False
        return same and _all_locked(self.folder, self.manifest)

    def keys(self) -> dict[str, Key]:
        """Keys without the pipeline's name, and what is known of each."""
        prefix = f"{self.manifest.name}/"
        return {key.removeprefix(prefix): known for key, known in self.manifest.keys.items()}


class RunFolder:
    """A run folder while its supervisor lives: `with RunFolder(name, hosts) as run: run.path`.

    Raises AlreadyUpError naming pid and time, and RunFolderError for a folder of somebody else.
    What a predecessor that died without a word left behind, files and processes, is removed:
    `unclean` says that there was one, `leftovers` which processes were killed. `resumes` says that
    it died just now, with the same `digest` and `epoch`: then the states of its nodes are kept.
    """

    def __init__(self, name: str, hosts: Sequence[str], digest: str = "", epoch: int = 0) -> None:
        self.path = folder_of(name, hosts)
        base = self.path.parents[1]
        _own(base, private=VARIABLE not in os.environ)
        _own(self.path.parent)
        self._locks: list[int] = []
        try:
            for host in sorted(hosts):
                self._locks.append(_lock(self.path.parent / f"{host}.lock", f"{name}@{host}"))
        except BaseException:
            self._unlock()
            raise
        self.unclean = self.path.is_dir() and any(not each.is_dir() for each in self.path.iterdir())
        self.leftovers = kill_marked(marker_of(self.path)) if self.unclean else []
        self.resumes = self.unclean and _died_just_now(self.path, digest, epoch)
        self._clear(every=not self.resumes)
        _own(self.path)
        _own(self.path / STATE)

    def publish(self, manifest: Manifest) -> None:
        """Let tools know what runs; the file appears as a whole."""
        part = self.path / f"{MANIFEST}.part"
        part.write_text(json.dumps(asdict(manifest)), encoding="utf-8")
        part.replace(self.path / MANIFEST)

    def close(self) -> None:
        """Nothing runs here any more; states of nodes stay until the next start."""
        self._clear(every=False)
        self._unlock()

    def _clear(self, every: bool) -> None:
        """Remove all that is here, or all but the states."""
        if every:
            shutil.rmtree(self.path, ignore_errors=True)
            return
        with contextlib.suppress(FileNotFoundError):  # somebody tidied up
            for entry in self.path.iterdir():
                if not entry.is_dir():
                    entry.unlink(missing_ok=True)

    def _unlock(self) -> None:
        for lock in self._locks:
            os.close(lock)
        self._locks.clear()

    def __enter__(self) -> RunFolder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _died_just_now(folder: Path, digest: str, epoch: int) -> bool:
    """Whether the states of a dead run still hold: same pipeline, same clock, no age."""
    try:
        values = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        newest = max(file.stat().st_mtime for file in (folder / STATE).iterdir())
        same = values["digest"] == digest and abs(values["epoch"] - epoch) < SAME_CLOCK_NS
    except (OSError, ValueError, KeyError, TypeError):
        return False
    return bool(same) and abs(time.time() - newest) < RESUME_S


def base_folder() -> Path:
    """The folder of all run folders of this user."""
    if given := os.environ.get(VARIABLE):
        return Path(given).absolute()
    if runtime := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(runtime) / "lodeline"
    return Path(f"/tmp/lodeline-{os.geteuid()}")  # noqa: S108 - owner and mode are checked


def log_folder() -> Path:
    """The folder of what pipelines of this user printed, `NAME/HOST/NODE.log`: it is kept."""
    if given := os.environ.get(VARIABLE):
        return Path(given).absolute() / ".logs"
    if state := os.environ.get("XDG_STATE_HOME"):
        return Path(state) / "lodeline"
    return Path(os.environ.get("HOME", f"/tmp/lodeline-{os.geteuid()}")) / ".local/state/lodeline"  # noqa: S108 - made 0700


def folder_of(name: str, hosts: Sequence[str]) -> Path:
    """The run folder of a pipeline on a host, or on a machine that plays several hosts."""
    base, host = base_folder(), host_word(hosts)
    # The first part holds the locks, so it must not depend on which hosts are played here.
    parent = base / name
    if _length(parent / _short(host)) > MAX_PATH:
        parent = base / _short(name)
    folder = parent / host
    if _length(folder) > MAX_PATH:
        folder = parent / _short(host)
    if _length(folder) > MAX_PATH:
        raise RunFolderError(f"{base} is too long for sockets: set {VARIABLE} to a short path")
    return folder


def host_word(hosts: Sequence[str]) -> str:
    """Hosts as one word that may stand in a path and in a key."""
    return "+".join(sorted(hosts))


def marker_of(folder: Path) -> str:
    """Start of the environment entry by which processes of a run folder are known."""
    return f"NOTIFY_SOCKET={folder}/"


def running(name: str | None = None, base: Path | None = None) -> list[Running]:
    """Pipelines (all, or those called `name`) that run on this machine as this user."""
    folders = base or base_folder()
    found = [item for item in _manifests(folders) if name in (None, item.manifest.name)]
    return sorted(found, key=lambda item: (item.manifest.name, item.manifest.host))


def _manifests(base: Path) -> Iterator[Running]:
    for file in base.glob(f"*/*/{MANIFEST}"):
        try:
            written = file.stat().st_mtime_ns
            values = json.loads(file.read_text(encoding="utf-8"))
            values["keys"] = {key: Key(**known) for key, known in values["keys"].items()}
            values["hosts"] = tuple(values["hosts"])
            values["withheld"] = tuple(values["withheld"])
            values["overrides"] = tuple(values["overrides"])
            values["readers"] = {
                key: tuple(Reader(**reader) for reader in readers)
                for key, readers in values["readers"].items()
            }
            manifest = Manifest(**values)
        except (OSError, ValueError, KeyError, TypeError):
            continue  # gone in this moment, or written by another version
        if _all_locked(file.parent, manifest):
            yield Running(file.parent, manifest, written)


def _all_locked(folder: Path, manifest: Manifest) -> bool:
    return all(_is_locked(folder.parent / f"{host}.lock") for host in manifest.hosts)


def _lock(file: Path, what: str) -> int:
    """Descriptor that holds the lock while it is open."""
    lock = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    deadline = time.monotonic() + LOCK_PATIENCE_S
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            break
        except BlockingIOError:
            # `running` tests a lock by holding it for an instant: that is no supervisor.
            if time.monotonic() > deadline:
                holder = os.pread(lock, 80, 0).decode(errors="replace").strip()
                os.close(lock)
                raise AlreadyUpError(
                    f"ALREADY_UP {what}: {holder}; stop it first, by Ctrl-C there"
                ) from None
            time.sleep(0.01)
    os.ftruncate(lock, 0)
    os.pwrite(lock, f"pid {os.getpid()} since {time.strftime('%Y-%m-%d %H:%M:%S')}".encode(), 0)
    return lock


def _is_locked(file: Path) -> bool:
    try:
        lock = os.open(file, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(lock)
    return False


def _own(folder: Path, private: bool = True) -> None:
    """Make the folder ours alone, or refuse it."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.lstat()
    except OSError as error:
        raise RunFolderError(f"cannot make {folder}: {error.strerror}") from None
    if not stat.S_ISDIR(found.st_mode):
        raise RunFolderError(f"{folder} is no folder: remove it")
    if found.st_uid != os.geteuid():
        raise RunFolderError(f"{folder} belongs to user {found.st_uid}: refused")
    if private and stat.S_IMODE(found.st_mode) & 0o077:
        folder.chmod(0o700)


def _short(word: str) -> str:
    return hashlib.sha256(word.encode()).hexdigest()[:8]


def _length(path: Path) -> int:
    return len(os.fsencode(path))
