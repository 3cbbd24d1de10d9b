"""RGB-D images of a world by ray casting: colour, z-depth, cast shadows.

Rays are cast only where a body or its shadow may be seen; elsewhere the backdrop looks as it does when empty.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from cliport_core import Pose
from cliport_perception import CameraModel
from sim_bridge.rendering.appearance import Appearance
from sim_bridge.rendering.backdrop import FLOOR_Z, TABLE_Z
from sim_bridge.rendering.backdrop_view import BackdropView
from sim_bridge.rendering.bodies import Body, bodies_of
from sim_bridge.rendering.clean_frame import CleanFrame
from sim_bridge.rendering.image_window import ImageWindow
from sim_bridge.rendering.lit_scene import LitScene
from sim_bridge.rendering.part import parts_of
from sim_bridge.rendering.rays import Rays, turned
from sim_bridge.rendering.shading import shade
from sim_bridge.rendering.view import View, along_light
from sim_bridge.rendering.visible import Visible


class Renderer:
    """Renders worlds through one camera; the same world gives the same image.

    window: the part of the image that is computed; frames are that large.
    n_threads: 0 uses every core; the image does not depend on it.
    """

    def __init__(self, camera: CameraModel, window: ImageWindow, n_threads: int = 0) -> None:
        self.camera = camera
        self._window = window
        self._n_threads = n_threads
        self._rays_in_camera = np.ascontiguousarray(camera.rays()[window.slices]).reshape(-1, 3)
        self._lengths = np.linalg.norm(self._rays_in_camera, axis=1)
        self._backdrop: tuple[object, BackdropView] | None = None

    def render(self, world: Visible, camera_in_base: Pose, appearance: Appearance) -> CleanFrame:
        """Return the image of a camera at that pose (optical frame: z forward, x right, y down)."""
        backdrop = self._backdrop_view(camera_in_base, appearance)
        view = View(self.camera, self._window, camera_in_base)
        to_light = np.array(appearance.to_light, dtype=np.float32)
        bodies = _visible_bodies(bodies_of(world, appearance), view, backdrop, to_light)
        scene = LitScene(parts_of(bodies, appearance, self._n_threads), appearance)
        color, depth, facing = backdrop.color.copy(), backdrop.depth.copy(), backdrop.facing.copy()

        outlines = [body.outline for body in bodies]
        covered = view.silhouettes(outlines).ravel()
        rows = np.flatnonzero(covered)
        rays = backdrop.rays.take(rows)
        seen = scene.look(rays)
        color[rows], depth[rows], facing[rows] = seen.color, seen.depth, rays.facing(seen.normal)

        for heights, sunny in ((TABLE_Z, backdrop.sunny_table), (FLOOR_Z, backdrop.sunny_floor)):
            if sunny.any():
                prisms = [np.concatenate([along_light(outline, to_light, z) for z in heights]) for outline in outlines]
                rows = np.flatnonzero(sunny & ~covered & view.silhouettes(prisms).ravel())
                dark = rows[~scene.sunny(backdrop.rays.take(rows), backdrop.depth[rows], backdrop.normal[rows])]
                own = np.array(appearance.floor_rgb, dtype=np.float32)
                if sunny is backdrop.sunny_table:
                    own = appearance.table_colors(backdrop.rays.take(dark).points(backdrop.depth[dark]))
                color[dark] = shade(appearance, own, backdrop.normal[dark], True)
        shape = self._window.shape
        return CleanFrame(color.reshape(*shape, 3), depth.reshape(shape), facing.reshape(shape))

    def _backdrop_view(self, camera_in_base: Pose, appearance: Appearance) -> BackdropView:
        """Return the view of the empty backdrop, made anew when camera or light have changed."""
        key = camera_in_base.as_matrix().tobytes(), appearance
        if self._backdrop is None or self._backdrop[0] != key:
            directions = turned(self._rays_in_camera, camera_in_base.rotation)
            rays = Rays(camera_in_base.translation.astype(np.float32), directions, self._lengths)
            self._backdrop = key, BackdropView.along(rays, appearance, self._n_threads)
        return self._backdrop[1]


def _visible_bodies(
    bodies: Sequence[Body], view: View, backdrop: BackdropView, to_light: npt.NDArray[np.float32]
) -> list[Body]:
    """Return the bodies that can be seen, or throw a shadow on anything that can."""
    if not bodies:
        return []
    boxes = np.stack([body.box for body in bodies])
    matter = view.may_see(np.concatenate([boxes, along_light(boxes, to_light, backdrop.lowest)], axis=1))
    return [body for body, matters in zip(bodies, matter) if matters]
