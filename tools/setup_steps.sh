# Functions of tools/setup and tools/check_page: steps that leave a stamp in $stamps, and are not done again.

fail() { echo "error: $*" >&2; exit 1; }
stamped() { [ "$(cat "$stamps/$1" 2>/dev/null)" = "$2" ]; }
stamp() { mkdir -p "$stamps"; printf '%s\n' "$2" >"$stamps/$1"; }

# Runs a command up to four times: downloads fail now and then.
retry() {
    local attempt
    for attempt in 1 2 3 4; do
        "$@" && return 0
        [ "$attempt" = 4 ] || { echo "    failed, trying again in $((attempt * 5)) s"; sleep $((attempt * 5)); }
    done
    return 1
}
