# Functions of tools/setup: which extras, which build of PyTorch, and whether the locked packages. What was chosen is
# kept in .setup/choice, and holds until something else is chosen.

all_extras="runtime train simulate develop"
added_extras="driver" # what "all" leaves out: who drives no arm of their own needs none of it

# Prints what was chosen before: kept extras|torch|locked.
kept() { [ ! -f "$stamps/choice" ] || sed -n "s/^$1=//p" "$stamps/choice"; }

# Sets $extras, $torch and $locked from EXTRAS, TORCH and LOCKED, else from what was chosen before.
choose() {
    local name wanted=${EXTRAS:-$(kept extras)}
    wanted=" ${wanted//,/ } "
    [ -n "${wanted// /}" ] || wanted=" all "
    wanted=${wanted/ all / $all_extras }
    for name in $wanted; do
        case " $all_extras $added_extras " in *" $name "*) ;; *)
            fail "EXTRAS names $name: it takes all, or some of $all_extras $added_extras" ;;
        esac
    done
    extras=runtime
    for name in train simulate develop $added_extras; do
        case $wanted in *" $name "*) extras+=" $name" ;; esac
    done
    torch=${TORCH:-$(kept torch)} torch=${torch:-default}
    case $torch in cpu | default) ;; *) fail "TORCH is $torch: it takes cpu or default" ;; esac
    locked=${LOCKED:-$(kept locked)} locked=${locked:-0}
    case $locked in 0 | 1) ;; *) fail "LOCKED is $locked: it takes 1 or 0" ;; esac
    [ "$locked$torch" != 1cpu ] ||
        fail "the lock holds PyTorch's ordinary build: take one of LOCKED=1 (then TORCH=default) and TORCH=cpu (then LOCKED=0)"
}

keep_choice() {
    mkdir -p "$stamps"
    printf '%s\n' "extras=$extras" "torch=$torch" "locked=$locked" >"$stamps/choice"
}

has_extra() { case " $extras " in *" $1 "*) ;; *) return 1 ;; esac; }

# Fails in one line when an extra is not among the chosen ones.
require_extras() {
    local name missing=
    for name in "$@"; do has_extra "$name" || missing+=" $name"; done
    [ -z "$missing" ] || fail "this needs more than was set up ($extras): run 'make setup EXTRAS=\"$extras$missing\"'"
}

# Prints the requirement files of the chosen extras.
requirement_files() {
    local name
    for name in $extras; do echo "requirements-$name.txt"; done
    [ "$ros" = system ] || echo requirements-ros.txt
}

# Prints what the installed packages depend on: another key means another installation.
packages_key() {
    [ "$locked" = 0 ] || set -- requirements-locked.txt
    echo "$ros $python_version ${extras// /,} torch=$torch locked=$locked $(cat "$@" | sha256sum | cut -c1-16)"
}

# Prints what the built workspace depends on of the packages: another choice of extras builds nothing anew.
underlay_key() {
    echo "$ros $python_version locked=$locked $(cat requirements-ros.txt requirements-runtime.txt | sha256sum | cut -c1-16)"
}

# Prints the lines of the lock that belong to the chosen extras; it was made for one Python on one kind of machine.
locked_requirements() {
    local groups=$extras here
    here="$python_version $(uname -m)"
    grep -qx "# Python and machine: $here" requirements-locked.txt ||
        fail "LOCKED=1 takes Python$(sed -n 's/^# Python and machine://p' requirements-locked.txt), and this is $here: try LOCKED=0"
    [ "$ros" = system ] || groups+=" ros"
    awk -v groups="$groups" 'BEGIN {split(groups, names, " ")}
        /^[^#]/ {of = $0; sub(/.*# /, "", of); of = " " of " "
                 for (i in names) if (index(of, " " names[i] " ")) {print; break}}' requirements-locked.txt
}

# Prints which of PyTorch's packages the given requirement files pin, as builds for processors alone.
cpu_pins() { sed -nE 's/^(torch|torchvision)==([0-9.]+)$/\1==\2+cpu/p' "$@"; }

# Finds PyTorch's builds for processors alone: in the package index of pip's settings, in TORCH_INDEX, or with uv, which
# knows where they are. Writes them to .setup/torch.txt as constraints; says in one line when there are none.
find_cpu_torch() {
    local pins; pins=$(cpu_pins "$@")
    mkdir -p "$stamps"; rm -f "$stamps/torch.txt"
    if "$venv/bin/python" -m pip install --quiet --dry-run --no-deps \
        ${TORCH_INDEX:+--extra-index-url "$TORCH_INDEX"} $pins >"$stamps/torch.log" 2>&1; then
        echo "    PyTorch's builds for processors alone, as pip found them"
    elif command -v uv >/dev/null && uv pip install --quiet --python "$venv/bin/python" --torch-backend cpu $pins \
        >>"$stamps/torch.log" 2>&1; then
        echo "    PyTorch's builds for processors alone, as uv found them"
    else
        echo "    no CPU build of PyTorch found, so the ordinary one follows; TORCH_INDEX=URL names an index that has it" >&2
        torch=default
        return 0
    fi
    printf '%s\n' $pins >"$stamps/torch.txt"
}

# Removes what a build of PyTorch for graphics cards left behind, or the other build where the ordinary one is wanted.
remove_other_torch() {
    local names='^(nvidia-|triton==|cuda-)'
    [ "$torch" = cpu ] || names='^(torch|torchvision)==[^ ]*[+]cpu'
    "$venv/bin/python" -m pip list --local --format=freeze 2>/dev/null | { grep -E "$names" || true; } | cut -d= -f1 |
        xargs -r "$venv/bin/python" -m pip uninstall -y -q
}
