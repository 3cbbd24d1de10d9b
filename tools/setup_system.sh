# Functions of tools/setup: what the system must bring, in Debian's and Ubuntu's names.

# Prints the packages whose file or command is not there, on one line.
missing_system_packages() {
    local libraries missing=() python
    libraries=$( (ldconfig -p || /sbin/ldconfig -p) 2>/dev/null)
    need_library() { case $libraries in *"$1 "*) ;; *) missing+=("$2") ;; esac; }
    need_command() { command -v "$1" >/dev/null || missing+=("$2"); }

    need_library libgomp.so.1 libgomp1
    if has_extra simulate; then # these four: Open3D
        need_library libusb-1.0.so.0 libusb-1.0-0
        need_library libGL.so.1 libgl1
        need_library libEGL.so.1 libegl1
        need_library libX11.so.6 libx11-6
    fi
    need_command g++ g++ # these three: packages of messages
    need_command cmake cmake
    need_command make make
    # The page's tests; Ubuntu has it as a snap only, and they are skipped where it is not.
    if [ -n "$for_tests" ] && grep -qx ID=debian /etc/os-release 2>/dev/null; then need_command chromium chromium; fi
    if [ "$ros" = system ]; then need_command colcon python3-colcon-common-extensions; fi
    if [ ! -x "$venv/bin/python" ]; then
        python=$(find_python 2>/dev/null) || missing+=(python3)
        if [ -z "$python" ] || ! complete_python "$python"; then missing+=(python3-venv python3-dev); fi
    fi
    echo "${missing[*]-}"
}

# Installs packages. Where that is not allowed it says so in one line and leaves them in $lacking.
install_system_packages() {
    local as_root=() proxies=() name
    for name in http_proxy https_proxy no_proxy all_proxy HTTP_PROXY HTTPS_PROXY NO_PROXY ALL_PROXY; do
        [ -z "${!name:-}" ] || proxies+=("$name=${!name}")
    done
    if [ "$(id -u)" != 0 ]; then
        if ! command -v sudo >/dev/null; then
            lacking="$*"
        elif sudo -n true 2>/dev/null; then
            as_root=(sudo -n)
        elif [ -t 0 ] && [ -t 2 ]; then
            echo "    sudo asks for your password, to install them with apt-get" >&2
            if sudo -v; then as_root=(sudo); else lacking="$*"; fi
        else
            lacking="$*"
        fi
    fi
    command -v apt-get >/dev/null || fail "system packages are missing and there is no apt-get: install what Debian calls $*"
    if [ -n "$lacking" ]; then
        echo "    not installed, as this user may not: an administrator does it with: apt-get install -y $lacking" >&2
        return 0
    fi
    [ ${#as_root[@]} = 0 ] || as_root+=(env "DEBIAN_FRONTEND=noninteractive" ${proxies[@]+"${proxies[@]}"})
    mkdir -p "$stamps"
    retry ${as_root[@]+"${as_root[@]}"} apt-get -q update </dev/null >"$stamps/apt.log" 2>&1 || fail "apt-get update failed: see .setup/apt.log"
    retry ${as_root[@]+"${as_root[@]}"} apt-get -q -o DPkg::Lock::Timeout=300 install -y --no-install-recommends "$@" </dev/null >>"$stamps/apt.log" 2>&1 ||
        fail "apt-get install $* failed: see .setup/apt.log"
}
