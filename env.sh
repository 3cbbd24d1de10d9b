# Source this in bash or zsh: the shell then has this project's Python, its ROS packages and `ros2`.
#   source env.sh
# With ROS 2 Jazzy sourced beforehand the system's ROS and its real `ros2` are used.

if [ -n "${BASH_SOURCE:-}" ]; then
    _cliport_root=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
elif [ -n "${ZSH_VERSION:-}" ]; then
    _cliport_root=$(cd "$(dirname "$0")" && pwd)
else
    _cliport_root=$(pwd)
fi

if [ ! -x "$_cliport_root/.venv/bin/python" ] || [ ! -f "$_cliport_root/install/local_setup.sh" ]; then
    echo "error: the project is not set up yet: run 'make setup' in $_cliport_root" >&2
    unset _cliport_root
    return 1 2>/dev/null || exit 1
fi

export VIRTUAL_ENV="$_cliport_root/.venv"
case ":$PATH:" in
    *":$VIRTUAL_ENV/bin:"*) ;;
    *) export PATH="$VIRTUAL_ENV/bin:$PATH" ;;
esac
unset PYTHONHOME

if [ "${ROS_DISTRO:-}" != jazzy ]; then
    # The virtual environment is the ROS underlay; only what is built here comes on top of it.
    export AMENT_PREFIX_PATH="$VIRTUAL_ENV"
    # One machine is the normal case, and nodes find each other sooner. For several: SUBNET.
    export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
fi
# Images and clouds need more shared memory than Fast DDS takes by itself.
export FASTRTPS_DEFAULT_PROFILES_FILE="${FASTRTPS_DEFAULT_PROFILES_FILE:-$_cliport_root/src/cliport_bringup/config/fastdds.xml}"

if ! type ros2 >/dev/null 2>&1; then
    export PATH="$_cliport_root/tools/ros2/bin:$PATH"
fi

# colcon's own script expands unset variables.
case $- in *u*) _cliport_nounset=1; set +u ;; *) _cliport_nounset= ;; esac
COLCON_CURRENT_PREFIX="$_cliport_root/install"
COLCON_PYTHON_EXECUTABLE="$VIRTUAL_ENV/bin/python"
. "$_cliport_root/install/local_setup.sh"
unset COLCON_CURRENT_PREFIX COLCON_PYTHON_EXECUTABLE
[ -z "$_cliport_nounset" ] || set -u
unset _cliport_nounset _cliport_root
