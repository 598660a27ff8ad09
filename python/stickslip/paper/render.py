"""A small ray caster: round cones, boxes and a ground plane, with soft shadows. NumPy only.

Enough for pictures of robots in a report, without a window, a display or a graphics driver.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_BACKGROUND = np.array([0.957, 0.961, 0.969])
_GROUND = np.array([0.905, 0.912, 0.925])
_GRID = np.array([0.80, 0.815, 0.84])
_LIGHT = np.array([0.42, -0.34, 0.84]) / np.linalg.norm([0.42, -0.34, 0.84])  # towards the light
_SUN, _SKY, _BOUNCE = 0.86, np.array([0.50, 0.52, 0.56]), np.array([0.22, 0.21, 0.20])
_GRID_STEP = 0.25  # [m]
_SHADOW_CELLS = 420
_SHADOW_SOFTNESS = 0.014  # [m]


@dataclass(frozen=True)
class RoundCone:
    """The hull of two spheres; a capsule where the radii are equal, a sphere where the ends are."""

    a: Array  #: (3,) [m]
    b: Array
    radius_a: float
    radius_b: float
    color: tuple[float, float, float]
    glow: float = 0.0  #: 1: not shaded at all

    def bounds(self) -> tuple[Array, float]:
        """Center and radius of a sphere around it."""
        middle = (self.a + self.b) / 2
        return middle, float(np.linalg.norm(self.b - self.a) / 2 + max(self.radius_a, self.radius_b))

    def hit(self, origin: Array, direction: Array) -> tuple[Array, Array]:
        """Distance along unit rays (inf where missed) and unit normals."""
        axis = self.b - self.a
        length2 = float(axis @ axis)
        taper = self.radius_a - self.radius_b
        candidates = [_sphere(self.a, self.radius_a, origin, direction)]
        if length2 > max(taper * taper, 1e-12):
            candidates.append(_sphere(self.b, self.radius_b, origin, direction))
            candidates.append(self._side(axis, length2, taper, origin, direction))
        distance = np.full(direction.shape[:-1], np.inf)
        normal = np.zeros(direction.shape)
        for t, n in candidates:
            nearer = t < distance
            distance[nearer] = t[nearer]
            normal[nearer] = n[nearer]
        return distance, normal

    def _side(self, axis: Array, length2: float, taper: float, origin: Array, direction: Array) -> tuple[Array, Array]:
        # The cone that touches both spheres: a quadratic in t; y tells where along the axis the ray meets it.
        oa = origin - self.a
        slope2 = length2 - taper * taper  # > 0
        dd, do = direction @ axis, oa @ axis
        od = _dot(oa, direction)
        oo = _dot(oa, oa)
        k2 = slope2 - dd * dd
        k1 = slope2 * od - dd * do + taper * self.radius_a * dd
        k0 = slope2 * oo - do * do + 2 * taper * self.radius_a * do - self.radius_a**2 * length2
        root = k1 * k1 - k2 * k0
        ok = (root >= 0) & (np.abs(k2) > 1e-14)
        t = np.where(ok, (-np.sqrt(np.where(ok, root, 0)) - k1) / np.where(ok, k2, 1), np.inf)
        y = do - self.radius_a * taper + t * dd
        ok &= (y > 0) & (y < slope2) & (t > 0)
        t = np.where(ok, t, np.inf)
        point = oa + np.where(ok, t, 0)[..., None] * direction
        normal = slope2 * point - axis * np.where(ok, y, 0)[..., None]
        return t, normal / np.maximum(np.sqrt(_dot(normal, normal)), 1e-12)[..., None]


@dataclass(frozen=True)
class Box:
    """A box, turned by a rotation matrix."""

    center: Array  #: (3,) [m]
    rotation: Array  #: (3, 3)
    half: Array  #: (3,) half of the edge lengths [m]
    color: tuple[float, float, float]
    glow: float = 0.0

    def bounds(self) -> tuple[Array, float]:
        """Center and radius of a sphere around it."""
        return self.center, float(np.linalg.norm(self.half))

    def hit(self, origin: Array, direction: Array) -> tuple[Array, Array]:
        """Distance along unit rays (inf where missed) and unit normals."""
        o = (origin - self.center) @ self.rotation
        d = direction @ self.rotation
        d = np.where(np.abs(d) < 1e-12, 1e-12, d)
        middle, extent = -o / d, np.abs(self.half / d)
        enter, leave = np.broadcast_to(middle - extent, d.shape), np.broadcast_to(middle + extent, d.shape)
        near, far = enter.max(axis=-1), leave.min(axis=-1)
        t = np.where((near < far) & (near > 0), near, np.inf)
        face = enter.argmax(axis=-1)
        normal = np.zeros(d.shape)
        np.put_along_axis(normal, face[..., None], -np.sign(np.take_along_axis(d, face[..., None], -1)), -1)
        return t, normal @ self.rotation.T


def rounded_box(center: Array, rotation: Array, half: Array, radius: float, color) -> list:
    """A box with round edges, from three slabs and twelve edges."""
    inner = np.asarray(half) - radius
    parts: list = []
    for axis in range(3):
        extent = inner.copy()
        extent[axis] += radius
        parts.append(Box(center, rotation, extent, color))
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for su in (-1, 1):
            for sv in (-1, 1):
                corner = np.zeros(3)
                corner[u], corner[v] = su * inner[u], sv * inner[v]
                along = np.zeros(3)
                along[axis] = inner[axis]
                a, b = center + rotation @ (corner - along), center + rotation @ (corner + along)
                parts.append(RoundCone(a, b, radius, radius, color))
    return parts


@dataclass(frozen=True)
class Camera:
    """A pinhole that looks from `eye` to `target`, z up."""

    eye: Array
    target: Array
    field_of_view: float = 30.0  #: vertical [degree]

    def axes(self) -> Array:
        """Rows: right, down, forward."""
        forward = self.target - self.eye
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1])
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(forward, right), forward])


def render(
    parts: Iterable, camera: Camera, width: int, height: int, samples: int = 2, floor_opacity: float = 1.0
) -> NDArray[np.uint8]:
    """An RGB picture (height, width, 3); `samples` squared rays per pixel. What is below the floor shows if it is translucent."""
    parts = list(parts)
    w, h = width * samples, height * samples
    axes = camera.axes()
    focal = h / 2 / np.tan(np.radians(camera.field_of_view) / 2)
    x, y = np.meshgrid(np.arange(w) + 0.5 - w / 2, np.arange(h) + 0.5 - h / 2)
    direction = np.stack([x, y, np.full_like(x, focal)], axis=-1) @ axes
    direction /= np.sqrt(_dot(direction, direction))[..., None]

    distance, normal, color, glow = np.full((h, w), np.inf), np.zeros((h, w, 3)), np.zeros((h, w, 3)), np.zeros((h, w))
    for part in parts:
        center, radius = part.bounds()
        at = axes @ (center - camera.eye)
        if at[2] < radius * 1.05:
            continue
        reach = 1.1 * focal * radius / (at[2] - radius) + 2
        window = _window(w / 2 + focal * at[0] / at[2], h / 2 + focal * at[1] / at[2], reach, w, h)
        if window is None:
            continue
        t, n = part.hit(camera.eye, direction[window])
        nearer = t < distance[window]
        distance[window][nearer], normal[window][nearer] = t[nearer], n[nearer]
        color[window][nearer], glow[window][nearer] = part.color, part.glow

    shadow = _ShadowMap([p for p in parts if p.glow == 0])
    picture = np.broadcast_to(_BACKGROUND, (h, w, 3)).copy()
    floor = -camera.eye[2] / np.minimum(direction[..., 2], -1e-9)
    on_floor = (direction[..., 2] < 0) & (floor < distance)
    body = np.isfinite(distance) & (~on_floor if floor_opacity == 1 else True)
    points = camera.eye + distance[body][:, None] * direction[body]
    picture[body] = _shade_body(points, normal[body], direction[body], color[body], glow[body], shadow)
    tiles = _shade_floor(camera, direction[on_floor], floor[on_floor], shadow, parts)
    below = body[on_floor][:, None]
    picture[on_floor] = np.where(below, picture[on_floor] + floor_opacity * (tiles - picture[on_floor]), tiles)
    picture = picture.reshape(height, samples, width, samples, 3).mean(axis=(1, 3))
    return (np.clip(picture, 0, 1) ** (1 / 1.08) * 255 + 0.5).astype(np.uint8)


def _window(x: float, y: float, reach: float, w: int, h: int) -> tuple[slice, slice] | None:
    left, right = max(int(x - reach), 0), min(int(x + reach) + 1, w)
    top, bottom = max(int(y - reach), 0), min(int(y + reach) + 1, h)
    return None if left >= right or top >= bottom else (slice(top, bottom), slice(left, right))


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("...i,...i->...", a, b)


def _sphere(center: Array, radius: float, origin: Array, direction: Array) -> tuple[Array, Array]:
    oc = origin - center
    b = _dot(oc, direction)
    root = b * b - _dot(oc, oc) + radius * radius
    t = np.where(root >= 0, -b - np.sqrt(np.maximum(root, 0)), np.inf)
    t = np.where(t > 0, t, np.inf)
    return t, (oc + np.where(np.isfinite(t), t, 0)[..., None] * direction) / radius


class _ShadowMap:
    """How far the light reaches, on a grid across its direction."""

    def __init__(self, parts: list):
        bounds = [p.bounds() for p in parts]
        self._right = np.cross(_LIGHT, [0, 1, 0])
        self._right /= np.linalg.norm(self._right)
        self._up = np.cross(self._right, _LIGHT)
        middle = np.mean([c for c, _ in bounds], axis=0) if parts else np.zeros(3)
        self._origin = middle + 10 * _LIGHT
        self._half = max((np.linalg.norm(c - middle) + r for c, r in bounds), default=1.0) + 0.1
        n = _SHADOW_CELLS
        cells = (np.arange(n) + 0.5) / n * 2 - 1
        gx, gy = np.meshgrid(cells * self._half, cells * self._half)
        origins = self._origin + gx[..., None] * self._right + gy[..., None] * self._up
        self._depth = np.full((n, n), np.inf)
        for part, (center, radius) in zip(parts, bounds, strict=True):
            x, y = self._cell(center)
            window = _window(x, y, 1.1 * radius / self._half * n / 2 + 1, n, n)
            if window is None:
                continue
            patch = origins[window]
            t, _ = part.hit(patch, np.broadcast_to(-_LIGHT, patch.shape))
            self._depth[window] = np.minimum(self._depth[window], t)

    def _cell(self, points: Array) -> tuple[Array, Array]:
        n, d = _SHADOW_CELLS, points - self._origin
        return (d @ self._right / self._half + 1) * n / 2, (d @ self._up / self._half + 1) * n / 2

    def light(self, points: Array) -> Array:
        """Share of the light that reaches the points, 0 to 1."""
        n = _SHADOW_CELLS
        x, y = self._cell(points)
        depth = (self._origin - points) @ _LIGHT - 0.012
        softness = _SHADOW_SOFTNESS / self._half * n / 2
        lit = np.zeros(len(points))
        taps = 14
        for k in range(taps):  # a sunflower of samples
            r, angle = softness * np.sqrt((k + 0.5) / taps) * 1.6, 2.39996 * k
            i = np.clip((y + r * np.sin(angle)).astype(int), 0, n - 1)
            j = np.clip((x + r * np.cos(angle)).astype(int), 0, n - 1)
            lit += self._depth[i, j] > depth
        inside = (x > 2) & (x < n - 2) & (y > 2) & (y < n - 2)
        return np.where(inside, lit / taps, 1.0)


def _shade_floor(camera: Camera, direction: Array, distance: Array, shadow: _ShadowMap, parts: list) -> Array:
    points = camera.eye + distance[:, None] * direction
    points[:, 2] = 0
    # lines one pixel and a half wide, fading with distance
    width = 0.0035 + 0.0006 * distance
    to_line = np.abs((points[:, :2] / _GRID_STEP + 0.5) % 1 - 0.5) * _GRID_STEP
    line = np.clip(1.5 - to_line.min(axis=1) / width, 0, 1)
    base = _GROUND + (line[:, None] * 0.75) * (_GRID - _GROUND)
    occlusion = _floor_occlusion(points[:, :2], parts)
    lit = shadow.light(points)
    shaded = base * (0.60 + 0.40 * lit)[:, None] * occlusion[:, None]
    offset = points[:, :2] - camera.target[:2]
    far = np.sqrt(_dot(offset, offset))
    fade = np.clip((far - 1.0) / 1.5, 0, 1) ** 1.2
    return shaded + fade[:, None] * (_BACKGROUND - shaded)


def _floor_occlusion(points: Array, parts: list) -> Array:
    """Share of the sky that points (k, 2) of the floor see past the feet and other low ends."""
    seen = np.ones(len(points))
    for part in parts:
        if part.glow > 0 or isinstance(part, Box):
            continue
        end, radius = min(((part.a, part.radius_a), (part.b, part.radius_b)), key=lambda e: e[0][2] - e[1])
        height = max(end[2], radius)
        if end[2] < -radius or height > 4 * radius:
            continue
        offset = points - end[:2]
        d2 = _dot(offset, offset) + height * height
        # a sphere over a plane hides radius^2 height / d^3 of a uniform sky
        seen *= 1 - 0.75 * np.minimum(1, radius * radius * height / (d2 * np.sqrt(d2)))
    return seen


def _shade_body(points: Array, normal: Array, direction: Array, color: Array, glow: Array, shadow: _ShadowMap) -> Array:
    lit = shadow.light(points + 0.004 * normal)
    facing = np.clip(normal @ _LIGHT, 0, 1) * lit
    up = (normal[:, 2:] + 1) / 2
    ambient = _BOUNCE + up * (_SKY - _BOUNCE)
    near_ground = np.clip(np.abs(points[:, 2:]) / 0.12, 0, 1) * 0.35 + 0.65
    half = _LIGHT - direction
    half /= np.sqrt(_dot(half, half))[:, None]
    gloss = 0.22 * np.clip(_dot(normal, half), 0, 1) ** 40 * lit
    rim = 0.16 * (1 - np.clip(-_dot(normal, direction), 0, 1)) ** 3
    shaded = color * (ambient * near_ground + _SUN * facing[:, None]) + (gloss + rim)[:, None]
    return shaded + glow[:, None] * (color - shaded)
