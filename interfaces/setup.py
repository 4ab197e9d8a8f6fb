"""Build an ament_cmake package with the rosidl wheels, so that ``pip install ./interfaces`` works.

CMakeLists.txt does the work, as in any ROS workspace (colcon never reads this file). Here it installs
into a stage folder, whose parts go where the wheels' own packages are: the Python modules into
site-packages, the libraries into ``<environment>/lib``, the definitions into ``<environment>/share``.
The package is the one beside this file; ``interfaces_tf2/setup.py`` runs the same text for its own.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator
from importlib.metadata import distribution
from pathlib import Path
from xml.etree import ElementTree

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

SOURCE = Path(__file__).resolve().parent
MANIFEST = ElementTree.parse(SOURCE / "package.xml")
PACKAGE = str(MANIFEST.findtext("name"))
DATA = (  # CMake files and shell hooks are left out: who compiles against this package builds it with colcon
    "lib/*.so",
    "share/ament_index/resource_index/packages/*",
    "share/ament_index/resource_index/rosidl_interfaces/*",
    f"share/{PACKAGE}/package.xml",
    f"share/{PACKAGE}/msg/*",
    f"share/{PACKAGE}/srv/*",
)


def package_version() -> str:
    """Return the version that package.xml declares."""
    version = MANIFEST.findtext("version")
    if version is None:
        raise SystemExit(f"{PACKAGE}: package.xml has no <version>")
    return version


def missing_tool() -> str | None:
    """Name the first thing that compiling needs and this machine lacks, with its Debian package."""
    tools = {
        "C compiler": ([os.environ.get("CC", ""), "cc", "gcc", "clang"], "gcc"),
        "C++ compiler": ([os.environ.get("CXX", ""), "c++", "g++", "clang++"], "g++"),
        "make": (["make"], "make"),
    }
    for tool, (commands, debian_package) in tools.items():
        if not any(shutil.which(command.split()[0]) for command in commands if command):
            return f"no {tool} found: install one (Debian, Ubuntu: apt install {debian_package})"
    if not (Path(sysconfig.get_path("include")) / "Python.h").is_file():
        return f"no Python.h found: install the headers of {sys.executable} (Debian, Ubuntu: python3-dev)"
    return None


def ros_prefix() -> Path:
    """Return the prefix that the ROS wheels of the build environment are installed in."""
    ament_cmake = distribution("ros-ament-cmake")
    for parent in Path(str(ament_cmake.locate_file(""))).resolve().parents:
        if (parent / "share" / "ament_cmake" / "cmake").is_dir():
            return parent
    raise SystemExit(f"{PACKAGE}: the wheel ros-ament-cmake has no CMake files in its environment")


def build_into(stage: Path) -> None:
    """Configure, compile and install the package with CMake; its Python part goes to ``stage/python``."""
    prefix = ros_prefix()
    environment = {**os.environ, "AMENT_PREFIX_PATH": str(prefix), "CMAKE_PREFIX_PATH": str(prefix)}
    options = {
        "BUILD_TESTING": "OFF",
        "CMAKE_BUILD_TYPE": "Release",
        "CMAKE_INSTALL_PREFIX": str(stage),
        "PYTHON_INSTALL_DIR": "python",
        "Python3_EXECUTABLE": sys.executable,
    }
    with tempfile.TemporaryDirectory() as build:
        configure = ["cmake", "-S", str(SOURCE), "-B", build, *(f"-D{k}={v}" for k, v in options.items())]
        compile_ = ["cmake", "--build", build, "--parallel", str(os.cpu_count() or 1), "--target", "install"]
        for command in (configure, compile_):
            subprocess.run(command, env=environment, check=True)


def data_files(stage: Path) -> Iterator[tuple[str, list[str]]]:
    """Pair each installed library and definition with its folder below the environment's prefix."""
    for pattern in DATA:
        for path in sorted(stage.glob(pattern)):
            if path.is_file():
                yield str(path.parent.relative_to(stage)), [str(path)]


class BuildInterfaces(build_py):
    """The build step: generate and compile the package in place of copying Python sources."""

    def run(self) -> None:
        """Fill the build folder and name the data files."""
        missing = missing_tool()
        if missing:
            raise SystemExit(f"{PACKAGE}: {missing}, then run the same command again")
        stage = Path(self.build_lib).resolve().with_name("stage")
        modules = Path(self.build_lib) / PACKAGE
        for left_over in (stage, modules):
            shutil.rmtree(left_over, ignore_errors=True)
        build_into(stage)
        shutil.copytree(
            stage / "python" / PACKAGE, modules, ignore=shutil.ignore_patterns("*.c", "__pycache__")
        )
        self.distribution.data_files = list(data_files(stage))


class CompiledDistribution(Distribution):
    """A distribution whose wheel serves one Python version and platform."""

    def has_ext_modules(self) -> bool:
        """Tell setuptools to tag the wheel as compiled."""
        return True


setup(
    version=package_version(),
    packages=[PACKAGE],
    package_dir={PACKAGE: "."},
    distclass=CompiledDistribution,
    cmdclass={"build_py": BuildInterfaces},
)
