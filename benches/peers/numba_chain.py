"""The chain as one compiled loop; the count follows the path."""
import math

import numba
import numpy as np
from numba import njit, prange

from common import HEIGHT, MARGIN, SIGMA, THREADS, WIDTH, inputs, report

numba.set_num_threads(THREADS)


@njit(fastmath=True)
def integral(v0, v1, knot):
    h = min(max(knot, 0.0), 1.0)
    return h * (v0 + 0.5 * h * (v1 - v0)) + max(knot - 1.0, 0.0) * v1


@njit(parallel=True, fastmath=True)
def run(color, v0, v1, samples, adaptive, sigma, out):
    rows, columns = color.shape[0], color.shape[1]
    for y in prange(out.shape[0]):
        f = np.float32(y) / np.float32(out.shape[0])
        for x in range(out.shape[1]):
            vx = v0[y + MARGIN, x + MARGIN, 0] * (1 - f) + v1[y + MARGIN, x + MARGIN, 0] * f
            vy = v0[y + MARGIN, x + MARGIN, 1] * (1 - f) + v1[y + MARGIN, x + MARGIN, 1] * f
            px, py = x + MARGIN - (f - 0.5) * vx, y + MARGIN - (f - 0.5) * vy
            tx = min(max(int(math.floor(px + 0.5)), 0), columns - 1)
            ty = min(max(int(math.floor(py + 0.5)), 0), rows - 1)
            bx, by = integral(v0[ty, tx, 0], v1[ty, tx, 0], f), integral(v0[ty, tx, 1], v1[ty, tx, 1], f)
            mx = integral(v0[ty, tx, 0], v1[ty, tx, 0], f + 0.5) - bx
            my = integral(v0[ty, tx, 1], v1[ty, tx, 1], f + 0.5) - by
            wx = integral(v0[ty, tx, 0], v1[ty, tx, 0], f + 1.0) - bx
            wy = integral(v0[ty, tx, 1], v1[ty, tx, 1], f + 1.0) - by
            n = samples
            if adaptive:
                path = math.sqrt(mx * mx + my * my) + math.sqrt((wx - mx) ** 2 + (wy - my) ** 2)
                n = max(1, min(samples, int(math.ceil(path - 0.001))))
            ax, ay, cx, cy = 4 * mx - wx, 4 * my - wy, 2 * wx - 4 * mx, 2 * wy - 4 * my
            r = g = b = np.float32(0)
            for i in range(n):
                u = np.float32((i + 0.5) / n)
                sx, sy = px - u * (ax + u * cx), py - u * (ay + u * cy)
                ix = min(max(int(sx), 0), columns - 2)
                iy = min(max(int(sy), 0), rows - 2)
                kx, ky = np.float32(sx - ix), np.float32(sy - iy)
                k00, k10, k01, k11 = (1 - kx) * (1 - ky), kx * (1 - ky), (1 - kx) * ky, kx * ky
                c00, c10, c01, c11 = color[iy, ix], color[iy, ix + 1], color[iy + 1, ix], color[iy + 1, ix + 1]
                r += k00 * c00[0] + k10 * c10[0] + k01 * c01[0] + k11 * c11[0]
                g += k00 * c00[1] + k10 * c10[1] + k01 * c01[1] + k11 * c11[1]
                b += k00 * c00[2] + k10 * c10[2] + k01 * c01[2] + k11 * c11[2]
            if sigma > 0:
                r, g, b = r / n, g / n, b / n
                r += np.random.normal(0.0, sigma)
                g += np.random.normal(0.0, sigma)
                b += np.random.normal(0.0, sigma)
                out[y, x, 0] = min(max(r + 0.5, 0.0), 255.0)
                out[y, x, 1] = min(max(g + 0.5, 0.0), 255.0)
                out[y, x, 2] = min(max(b + 0.5, 0.0), 255.0)
            else:
                out[y, x, 0], out[y, x, 1], out[y, x, 2] = r / n + 0.5, g / n + 0.5, b / n + 0.5


def make(motion):
    color, v0, v1 = inputs(motion)
    out = np.empty((HEIGHT, WIDTH, 3), np.uint8)

    def chain(noise):
        run(color, v0, v1, 240, True, 255.0 * SIGMA if noise else 0.0, out)
        return out

    return chain


for motion in ("moving", "tenth"):
    report("numba", motion, 240, make(motion))
