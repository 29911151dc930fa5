"""The chain as one would write it with OpenCV: a remap a sample, summed, noise added. No count that follows the path: a
remap takes the whole picture."""
import cv2
import numpy as np

from common import HEIGHT, MARGIN, SIGMA, THREADS, WIDTH, inputs, report

cv2.setNumThreads(THREADS)


def integral(v0, v1, knot):
    h = np.clip(knot, 0.0, 1.0)
    return h * (v0 + 0.5 * h * (v1 - v0)) + np.maximum(knot - 1.0, 0.0) * v1


def make(motion, samples):
    color, v0, v1 = inputs(motion)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)
    f = (np.arange(HEIGHT, dtype=np.float32) / HEIGHT)[:, None, None]
    inner = (slice(MARGIN, MARGIN + HEIGHT), slice(MARGIN, MARGIN + WIDTH))
    base = np.stack([x + MARGIN, y + MARGIN], axis=-1)

    def chain(noise):
        v = v0[inner] + f * (v1[inner] - v0[inner])
        seen = base - (f - 0.5) * v
        at = np.rint(seen).astype(np.int32)
        at[..., 0] = np.clip(at[..., 0], 0, color.shape[1] - 1)
        at[..., 1] = np.clip(at[..., 1], 0, color.shape[0] - 1)
        w0, w1 = v0[at[..., 1], at[..., 0]], v1[at[..., 1], at[..., 0]]
        begin = integral(w0, w1, f)
        middle = integral(w0, w1, f + 0.5) - begin
        whole = integral(w0, w1, f + 1.0) - begin
        a, b = 4.0 * middle - whole, 2.0 * whole - 4.0 * middle
        total = np.zeros((HEIGHT, WIDTH, 4), np.float32)
        for i in range(samples):
            u = np.float32((i + 0.5) / samples)
            place = seen - u * (a + u * b)
            cv2.accumulate(cv2.remap(color, place, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), total)
        total *= 1.0 / samples
        if noise:
            grain = np.empty((HEIGHT, WIDTH, 4), np.float32)
            cv2.randn(grain, 0.0, 255.0 * SIGMA)
            total += grain
        return cv2.convertScaleAbs(np.maximum(total, 0.0))[..., :3]

    return chain


for samples in (6, 24, 240):
    report("opencv", "moving", samples, make("moving", samples))
