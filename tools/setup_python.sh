# Functions of tools/setup: the interpreter, the virtual environment, the packages and the workspace's digest.

# Which Pythons this project runs on: torch has none for 3.10, OMPL none for 3.14.
supported="3.11, 3.12 or 3.13"

# Prints major.minor of an interpreter; fails when it is not one of these.
supported_version() {
    "$1" -c 'import sys
v = sys.version_info
print(f"{v[0]}.{v[1]}")
sys.exit(not (3, 11) <= v[:2] <= (3, 13))' 2>/dev/null
}

# Headers and ensurepip: Debian leaves both to packages of their own.
complete_python() {
    "$1" -c 'import sys, sysconfig, pathlib, ensurepip, venv
sys.exit(not pathlib.Path(sysconfig.get_path("include"), "Python.h").is_file())' 2>/dev/null
}

# Prints the interpreter to use: PYTHON when given, the one that ROS was built for, else the first complete one.
find_python() {
    local candidate first= found others=
    if [ -n "${PYTHON:-}" ]; then
        set -- "$PYTHON"
    elif [ "$ros" = system ]; then
        set -- /usr/bin/python3
    else
        set -- python3 /usr/bin/python3 /usr/local/bin/python3 python3.12 python3.11 python3.13
    fi
    for candidate in "$@"; do
        found=$(command -v "$candidate") || continue
        supported_version "$found" >/dev/null || { others+=" $found is $("$found" -V 2>&1 | head -1 | cut -c1-40);"; continue; }
        complete_python "$found" && { echo "$found"; return 0; }
        [ -n "$first" ] || first=$found
    done
    [ -n "$first" ] && { echo "$first"; return 0; }
    echo "error: Python $supported is needed;${others:- none of $* is there;} install one or name it with PYTHON=/path/to/python3" >&2
    return 1
}

# Rewrites what names the folder in which .venv was made, after the checkout was moved.
repair_moved_venv() {
    local from=$1 file
    for file in "$venv"/bin/*; do
        [ -f "$file" ] && [ ! -L "$file" ] && head -c 2 "$file" | grep -q '#!' || continue
        sed -i "1s|^#!$from/|#!$root/|" "$file"
    done
    sed -i "s|$from/.venv|$venv|g" "$venv"/bin/activate* "$venv/pyvenv.cfg" 2>/dev/null || true
    rm -rf build install log
    rm -f "$stamps/underlay" "$stamps/build"
}

# Whether .venv can be built on: its interpreter and pip run, and it sees the system's packages if and only if it should.
venv_usable() {
    local wanted=false; [ "$ros" = system ] && wanted=true
    [ -x "$venv/bin/python" ] && "$venv/bin/python" -c 'import pip' 2>/dev/null || return 1
    grep -qi "include-system-site-packages = $wanted" "$venv/pyvenv.cfg" ||
        fail ".venv was made $([ "$ros" = system ] && echo without || echo with) the system's ROS: remove .venv and .setup, then run 'make setup' again"
}

# Installs from requirement files, or those of their packages that the lock names; big downloads and the installation
# itself are shown, all else goes to .setup/pip.log.
install_python_packages() {
    local file options=()
    mkdir -p "$stamps"
    if [ "$locked" = 1 ]; then
        options=(--require-hashes --no-deps -r "$stamps/locked.txt")
    else
        for file in "$@"; do options+=(-r "$file"); done
        [ "$torch" = default ] || options+=(-c "$stamps/torch.txt" ${TORCH_INDEX:+--extra-index-url "$TORCH_INDEX"})
    fi
    "$venv/bin/python" -m pip install --progress-bar off --retries 8 --timeout 60 "${options[@]}" 2>&1 | tee "$stamps/pip.log" |
        awk '/^ *Downloading .*\(([0-9][0-9][0-9]\.[0-9] MB|[0-9.]+ GB)\)/ {sub(/^ +/, ""); print "    " $0; fflush()}
             /^Collecting / {n++; if (n % 50 == 0) {print "    " n " packages looked up"; fflush()}}
             /^Installing collected packages/ {print "    installing (some minutes)"; fflush()}
             /^ERROR|^error/ {print "    " $0; fflush()}'
}

# What a build depends on besides Python sources, which are linked, not copied.
workspace_digest() {
    {
        find src -type f \( -name package.xml -o -name setup.py -o -name setup.cfg -o -name CMakeLists.txt -o -name '*.msg' \
            -o -name '*.srv' -o -name '*.action' \) -not -path '*/test/*' -print0 | sort -z | xargs -0 sha256sum
        find src -type f \( -path '*/launch/*' -o -path '*/config/*' -o -path '*/resource/*' \) | sort
        sha256sum colcon.meta tools/build
    } | sha256sum | cut -c1-16
}
