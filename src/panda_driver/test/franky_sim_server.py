"""A franky-sim server with a post between the fingers, as a process: prints its address, runs until it is killed."""

from __future__ import annotations

import threading
from xml.etree import ElementTree

from franky_sim import SimulationServer
from franky_sim.mujoco_simulator import MujocoSimulator

from panda_model import load_preset

POST_WIDTH = 0.024  # [m]
_TCP = (0.3069, 0.0, 0.4869)  # at the ready pose [m]


def main() -> None:
    """Serve one arm at its ready pose."""
    with MujocoSimulator() as simulator:
        robot = simulator.add_robot(initial_q=load_preset("fr3").ready.tolist(), initial_hand_width=0.06)
        x, y, z = _TCP
        post = {"type": "cylinder", "size": f"{POST_WIDTH / 2.0} 0.01", "pos": f"{x} {y} {z}"}
        ElementTree.SubElement(simulator.worldbody, "geom", name="post", **post)
        with SimulationServer(simulator) as server:
            server.run_async()
            print(f"address {robot.hostname}", flush=True)
            threading.Event().wait()


if __name__ == "__main__":
    main()
