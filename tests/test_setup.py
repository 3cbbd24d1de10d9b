"""Steps of tools/setup on machines unlike this one: other Pythons, no administrator's rights, a moved checkout."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hardware_times import ROOT
from setup_shell import on_a_terminal, program, shell


def test_a_supported_python_is_taken(tmp_path):
    found = shell("find_python", tmp_path, PYTHON=sys.executable)
    assert (found.returncode, found.stdout.strip()) == (0, sys.executable)


@pytest.mark.parametrize("version", ["3.10.13", "3.14.2"])
def test_a_python_that_will_not_do_is_named_with_those_that_will(tmp_path, version):
    python = program(tmp_path / "python3", f'[ "$1" = -V ] && echo "Python {version}" || exit 1')
    found = shell("find_python", tmp_path, PYTHON=str(python))
    assert found.returncode == 1 and not found.stdout
    assert found.stderr == (
        f"error: Python 3.11, 3.12 or 3.13 is needed; {python} is Python {version}; "
        "install one or name it with PYTHON=/path/to/python3\n"
    )


@pytest.fixture
def no_rights(tmp_path: Path) -> dict[str, str]:
    """An ordinary user whose sudo asks for a password."""
    program(tmp_path / "bin/id", "echo 1001")
    program(tmp_path / "bin/sudo", "exit 1")
    program(tmp_path / "bin/apt-get", "exit 99")
    return {"PATH": f"{tmp_path}/bin:{os.environ['PATH']}"}


def test_without_rights_the_administrators_line_is_said_and_setup_goes_on(tmp_path, no_rights):
    done = shell('install_system_packages libgl1 cmake; echo "lacking: $lacking"', tmp_path, **no_rights)
    assert done.returncode == 0
    assert done.stdout == "lacking: libgl1 cmake\n"
    assert done.stderr.endswith("an administrator does it with: apt-get install -y libgl1 cmake\n")


def test_proxies_survive_sudo(tmp_path, no_rights):
    program(tmp_path / "bin/sudo", '[ "$*" = "-n true" ] || printf "%s\n" "$*" >>$stamps/asked')
    (tmp_path / ".setup").mkdir()
    done = shell("install_system_packages cmake", tmp_path, **no_rights, https_proxy="http://proxy.invalid:3128")
    assert done.returncode == 0, done.stderr
    update, install = (tmp_path / ".setup/asked").read_text().splitlines()
    for line in (update, install):
        assert line.startswith("-n env DEBIAN_FRONTEND=noninteractive https_proxy=http://proxy.invalid:3128 apt-get")
    assert install.endswith("install -y --no-install-recommends cmake")


ASKING_SUDO = (
    '[ "$*" != "-n true" ] || exit 1; [ "$1" != -v ] || { read -r word </dev/tty; [ "$word" = right ]; exit; }; '
    'printf "%s\n" "$*" >>$stamps/asked'
)


def test_on_a_terminal_the_password_is_asked_for_once(tmp_path, no_rights):
    program(tmp_path / "bin/sudo", ASKING_SUDO)
    (tmp_path / ".setup").mkdir()
    script = 'install_system_packages libgl1 cmake; echo "lacking: $lacking."'
    status, shown = on_a_terminal(script, tmp_path, "right\n", **no_rights)
    assert status == 0 and "lacking: .\n" in shown
    assert shown.index("sudo asks for your password, to install them with apt-get") < shown.index("lacking")
    _, install = (tmp_path / ".setup/asked").read_text().splitlines()
    assert install.startswith("env DEBIAN_FRONTEND=noninteractive apt-get ")
    assert install.endswith("install -y --no-install-recommends libgl1 cmake")


def test_without_a_password_the_administrators_line_is_said(tmp_path, no_rights):
    program(tmp_path / "bin/sudo", ASKING_SUDO)
    (tmp_path / ".setup").mkdir()
    script = 'install_system_packages libgl1 cmake; echo "lacking: $lacking."'
    status, shown = on_a_terminal(script, tmp_path, "wrong\n", **no_rights)
    assert status == 0 and "lacking: libgl1 cmake.\n" in shown
    assert "an administrator does it with: apt-get install -y libgl1 cmake\n" in shown
    assert not (tmp_path / ".setup/asked").exists()


def test_the_browser_is_asked_for_by_the_tests_alone(tmp_path):
    nothing = program(tmp_path / "bin/true", "").parent  # neither a browser nor a compiler here
    for program_name in ("grep", "dirname", "cut"):
        (nothing / program_name).symlink_to(f"/usr/bin/{program_name}")
    (nothing / "bash").symlink_to("/bin/bash")
    asked = [
        shell("missing_system_packages", tmp_path, PATH=str(nothing), for_tests=for_tests).stdout.split()
        for for_tests in ("", "1")
    ]
    assert "cmake" in asked[0] and "chromium" not in asked[0]
    assert set(asked[1]) - set(asked[0]) <= {"chromium"}  # where the system is Debian


def test_what_open3d_needs_is_asked_for_where_the_simulator_is(tmp_path):
    program(tmp_path / "bin/ldconfig", "")  # no libraries at all
    path = {"PATH": f"{tmp_path}/bin:{os.environ['PATH']}"}
    with_simulator = shell("missing_system_packages", tmp_path, **path).stdout.split()
    without = shell("missing_system_packages", tmp_path, **path, extras="runtime train").stdout.split()
    assert set(with_simulator) - set(without) == {"libusb-1.0-0", "libgl1", "libegl1", "libx11-6"}


def test_a_moved_virtual_environment_is_repaired(tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(here / ".venv")], check=True)
    tool = here / ".venv/bin/tool"
    tool.write_text(f"#!{here}/.venv/bin/python\nimport sys\nprint(sys.prefix)\n")
    tool.chmod(0o755)
    (here / "build").mkdir()
    here.rename(there)
    broken = subprocess.run(f"{there}/.venv/bin/tool", shell=True, capture_output=True, text=True)
    assert broken.returncode != 0
    done = shell(f"repair_moved_venv {here}", there)
    assert done.returncode == 0, done.stderr
    repaired = subprocess.run([there / ".venv/bin/tool"], capture_output=True, text=True, check=True)
    assert repaired.stdout == f"{there}/.venv\n"
    assert not (there / "build").exists()
    assert str(here) not in (there / ".venv/bin/activate").read_text()


@pytest.mark.parametrize(("own", "used"), [("", "src/cliport_bringup/config/fastdds.xml"), ("/own.xml", "/own.xml")])
def test_a_users_own_profile_of_fast_dds_is_kept(own: str, used: str) -> None:
    name = "FASTRTPS_DEFAULT_PROFILES_FILE"
    command = ["sh", "-c", f'. ./env.sh && printf %s "${name}"']
    found = subprocess.run(command, cwd=ROOT, env={**os.environ, name: own}, capture_output=True, text=True, timeout=60)
    assert found.stdout == str(ROOT / used) and (ROOT / used).is_file() is not bool(own)
