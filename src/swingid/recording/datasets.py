"""Public logs of real rigs, no part of swingid: who made them, their licence, address and checksums; how to get them.

An address names a commit, so what it gives never changes. A new data set is one entry in `CATALOGUE` and a rig file in
`examples/rigs/`. Files come from a local copy where there is one, else from their address; checksums are verified.
"""

from __future__ import annotations

import difflib
import hashlib
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from swingid.errors import InputError, UsageError
from swingid.recording.formats.isolated import require
from swingid.system import write_whole

if TYPE_CHECKING:
    from collections.abc import Iterator


GITHUB = "https://raw.githubusercontent.com"


@dataclass(frozen=True, slots=True)
class DataFile:
    """One file: its name here, its SHA-256, and its upstream address, None for one that exists as a copy only."""

    name: str
    sha256: str
    address: str | None
    about: str


@dataclass(frozen=True, slots=True)
class DataSet:
    """Logs of one rig. `rig` is the rig file that reads them, below `examples/rigs/`."""

    name: str
    title: str
    citation: str
    licence: str
    repository: str
    rig: str
    files: tuple[DataFile, ...]


EMPS = DataSet(
    name="emps",
    title="EMPS, a ball-screw drive: a linear axis, force known; 24.84 s at 1 kHz",
    citation="A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS, Workshop on Nonlinear System "
    "Identification Benchmarks, 2019",
    licence="Apache-2.0 (of the repository that holds the copy)",
    repository="forgi86/sysid-neural-continuous",
    rig="emps.toml",
    files=(
        DataFile(
            "DATA_EMPS.mat",
            "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e",
            f"{GITHUB}/forgi86/sysid-neural-continuous/956aa7ecd73061b0321c6f6098d74c9e4a7ce67a"
            "/examples/EMPS/data/DATA_EMPS.mat",
            "eight mirrored strokes",
        ),
    ),
)

_ARM = f"{GITHUB}/dynamicslab/MultiArm-Pendulum/e99a7e13fe2adc8fc647321a156b6cb59a48a698/ParameterEstimation"

FREE_PENDULUM = DataSet(
    name="free_pendulum",
    title="single arm of the Multi-Arm Pendulum: a free decay on ball bearings; 97 s at 1 kHz",
    citation="K. Kaheman, U. Fasel, J. J. Bramburger, B. Strom, J. N. Kutz, S. L. Brunton, The Experimental Multi-Arm "
    "Pendulum on a Cart: A Benchmark System for Chaos, Learning, and Control, arXiv:2205.06231, 2022",
    licence="MIT",
    repository="dynamicslab/MultiArm-Pendulum",
    rig="free_pendulum.toml",
    files=(
        DataFile(
            "SinglePendulumArm_RawData_1.mat",
            "a036ac5b7c21a4e282b2e44c6db45f3053bf0a57fad28689180da85bbdfaf221",
            f"{_ARM}/SinglePendulum/SinglePendulumArm_RawData_1.mat",
            "the log as the rig wrote it; read it with free_pendulum_simulink.toml",
        ),
        DataFile(
            "free_swing.csv",
            "7005d2b8bf6a02a78dfdc9854959846a8b5b50ca32029f36d1453103fee98998",
            None,
            "the same log as a table",
        ),
    ),
)

_BAM = f"{GITHUB}/Rhoban/bam/af2260462471ff45ac18af159b1327ea51d8db15/bam/data.bak/raw"

BAM_XL330 = DataSet(
    name="bam_xl330",
    title="Dynamixel XL330, a geared servo that swings 0.49 kg at 0.1 m; 6 s at 190 to 285 Hz",
    citation="M. Duclusaud, G. Passault, V. Padois, O. Ly, Extended Friction Models for the Physics Simulation of "
    "Servo Actuators, ICRA 2025, arXiv:2410.08650",
    licence="Apache-2.0",
    repository="Rhoban/bam",
    rig="bam_xl330.toml",
    files=(
        DataFile(
            "2026-01-15_10h28m42.json",
            "1c6386bfa3be021c8ca8a96a7cbee93914f6271a050282b1c3b7d5ef373427db",
            f"{_BAM}/2026-01-15_10h28m42.json",
            "sin_sin: driven throughout",
        ),
        DataFile(
            "2026-01-15_10h28m49.json",
            "e2223826274fca7799a2be0cb371e4269ead88cd9077fbb68498ef93e4e0de97",
            f"{_BAM}/2026-01-15_10h28m49.json",
            "lift_and_drop: torque off from 2.0 s, the only free decay",
        ),
        DataFile(
            "2026-01-15_10h28m57.json",
            "c10a350d9c7222d4d3499d140edd3ac4e63fe94f3b59a675116a34db7d66152c",
            f"{_BAM}/2026-01-15_10h28m57.json",
            "up_and_down: driven throughout",
        ),
        DataFile(
            "2026-01-15_10h29m04.json",
            "7996c43314a9f60094a6119346b54ff9ff84cb6726c967f4a88a7175278f6515",
            f"{_BAM}/2026-01-15_10h29m04.json",
            "sin_time_square: driven throughout",
        ),
    ),
)

_DFKI = f"{GITHUB}/dfki-ric-underactuated-lab/torque_limited_simple_pendulum/ed17ea2d32a35ad944944ca03ef57693e2986732"

DFKI_PENDULUM = DataSet(
    name="dfki_pendulum",
    title="torque-limited simple pendulum, direct drive: a difficult case, the scale of its torque is off; 200 Hz",
    citation="F. Wiebe, J. Babel, S. Kumar, S. Vyas, D. Harnack, M. Boukheddimi, M. Popescu, F. Kirchner, "
    "Torque-limited simple pendulum, Journal of Open Source Software 7(74), 3884, 2022",
    licence="BSD-3-Clause",
    repository="dfki-ric-underactuated-lab/torque_limited_simple_pendulum",
    rig="dfki_pendulum.toml",
    files=(
        DataFile(
            "energy_shaping.csv",
            "e1844e56f87cf763bdecb3f6f7e5b622a9a3b2d71e907b48ed6148b0a059c209",
            f"{_DFKI}/results/control_method_energy_shaping/data_measured.csv",
            "swing-up by energy; 0 to 4.6 s, then pushed by hand",
        ),
        DataFile(
            "sac.csv",
            "e2bfed62046a1bfdbfc8ff5322afd54acbf10521a683668c30ee39b241ea20d9",
            f"{_DFKI}/results/control_method_sac/data_measured.csv",
            "swing-up by a learned policy; 0 to 4.4 s, then pushed by hand",
        ),
    ),
)

CATALOGUE: tuple[DataSet, ...] = (EMPS, FREE_PENDULUM, BAM_XL330, DFKI_PENDULUM)


def find(name: str) -> DataSet:
    """The data set of that name; UsageError that names the nearest where there is none."""
    names = [one.name for one in CATALOGUE]
    wanted = name.lower().replace("-", "_")
    if wanted in names:
        return CATALOGUE[names.index(wanted)]
    near = difflib.get_close_matches(wanted, names, n=1)
    hint = f"the nearest is {near[0]}" if near else f"there are {', '.join(names)}"
    raise UsageError(f"no data set is called {name!r}; {hint}.", code="unknown-dataset")


TIMEOUT = 30.0  # s, for the address to answer

Origin = Literal["there", "copied", "downloaded", "copy-only"]


def get(dataset: DataSet, folder: Path, source: Path | None = None) -> Iterator[tuple[Path, Origin]]:
    """Put the files of a data set into `folder`; yields each path and how it came there, as it is done.

    source: a local copy, with the files in it or in a folder of the data set's name; default $SWINGID_DATA. What a
    `source` that was given lacks is not downloaded. "copy-only": a file without an address that no copy holds; it is
    left out. Raises InputError for a file with another checksum than the catalogue's, where nothing can be
    downloaded, and where the folder cannot be written.
    """
    stated = os.environ.get("SWINGID_DATA")
    place = source if source is not None else Path(stated) if stated else None
    if source is not None and not source.is_dir():
        raise InputError(f"{source} is not a folder; give the folder that holds the copy.", code="missing-folder")
    for file in dataset.files:
        target = folder / file.name
        if target.exists():
            _verify(target, file, "remove it and get the data set again")
            yield target, "there"
            continue
        copy = None if place is None else _copy_of(file, dataset, place)
        if copy is not None:
            _verify(copy, file, "use a copy of the original file")
            _put(copy, target)
            yield target, "copied"
        elif source is not None:
            message = f"{source} holds no {file.name}, neither itself nor in a folder {dataset.name}"
            raise InputError(f"{message}; leave --from out to download it.", code="missing-file")
        elif file.address is None:
            yield target, "copy-only"
        else:
            with tempfile.TemporaryDirectory() as scratch:
                _put(_download(file, file.address, Path(scratch)), target)
            yield target, "downloaded"


def _copy_of(file: DataFile, dataset: DataSet, place: Path) -> Path | None:
    candidates = (place / dataset.name / file.name, place / file.name)
    return next((path for path in candidates if path.is_file()), None)


def _verify(path: Path, file: DataFile, advice: str) -> None:
    """Raise InputError unless the file is the one of the catalogue, byte for byte."""
    try:
        found = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.", code="unreadable-file") from None
    if found != file.sha256:
        message = f"{path} is not the published file (SHA-256 {found[:12]}… instead of {file.sha256[:12]}…)"
        raise InputError(f"{message}; {advice}.", code="wrong-checksum")


def _put(origin: Path, target: Path) -> None:
    """Copy a file; it appears whole or not at all."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        content = origin.read_bytes()
    except OSError as error:
        raise InputError(f"cannot write {target}: {error.strerror}.", code="cannot-write") from None
    write_whole(target, content)


def _download(file: DataFile, address: str, scratch: Path) -> Path:
    """The file, downloaded into `scratch` and verified; InputError in one sentence where that fails."""
    pooch = require("pooch", "pooch", file.name, "to be downloaded", extra="datasets")
    pooch.get_logger().setLevel("ERROR")  # what it would say, the command says
    try:
        fetched = pooch.retrieve(
            address,
            known_hash=f"sha256:{file.sha256}",
            fname=file.name,
            path=scratch,
            downloader=pooch.HTTPDownloader(timeout=TIMEOUT),
        )
    except ValueError:
        message = f"what {address} gives is not the published file (its SHA-256 is another)"
        raise InputError(f"{message}; get it elsewhere and use --from DIR.", code="wrong-checksum") from None
    except OSError as error:  # requests' own exceptions are OSErrors, too
        answer = getattr(error, "response", None)
        if answer is not None:
            message = f"{address} answers {answer.status_code}; get {file.name} elsewhere"
            raise InputError(f"{message} and use --from DIR.", code="download-failed") from None
        message = f"no network: {address.split('/')[2]} cannot be reached for {file.name}; try again"
        raise InputError(f"{message}, or give a local copy with --from DIR.", code="no-network") from None
    return Path(fetched)
