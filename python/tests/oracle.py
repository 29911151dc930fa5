"""A rolling shutter of a camera that turns, worked out pixel by pixel in NumPy from the definition, without any of our code."""

import numpy as np


def turn_y(angle):
    """Camera turned to the right by an angle, rad: x right, y down, z forward."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def pose(angle):
    matrix = np.eye(4)
    matrix[:3, :3] = turn_y(angle)
    return matrix


def linear(byte):
    value = np.asarray(byte) / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def srgb(value):
    return np.where(value <= 0.0031308, value * 12.92, 1.055 * np.maximum(value, 1e-9) ** (1 / 2.4) - 0.055) * 255


def bilinear(plane, x, y):
    """At places in px; pixel centres are at +0.5. The border is repeated."""
    x, y = np.clip(x - 0.5, 0, plane.shape[1] - 1.001), np.clip(y - 0.5, 0, plane.shape[0] - 1.001)
    i, j = x.astype(int), y.astype(int)
    a, b = (x - i)[..., None], (y - j)[..., None]
    top = plane[j, i] * (1 - a) + plane[j, i + 1] * a
    return top * (1 - b) + (plane[j + 1, i] * (1 - a) + plane[j + 1, i + 1] * a) * b


def rolling(picture, matrix, size, margin, rate_rad_s, readout_s, color_time_s, time_s=0.0):
    """What a camera of `size` (height, width) that turns evenly sees of a far world of which `picture` shows `color_time_s`."""
    height, width = size
    v, u = np.mgrid[0:height, 0:width] + 0.5
    rays = np.stack([(u - matrix[0, 2]) / matrix[0, 0], (v - matrix[1, 2]) / matrix[1, 1], np.ones_like(u)], axis=-1)
    out = np.zeros((height, width, 3))
    for row in range(height):
        angle = rate_rad_s * (time_s + readout_s * row / height - color_time_s)
        seen = rays[row] @ turn_y(angle).T
        x = matrix[0, 0] * seen[:, 0] / seen[:, 2] + matrix[0, 2] + margin[0]
        y = matrix[1, 1] * seen[:, 1] / seen[:, 2] + matrix[1, 2] + margin[1]
        out[row] = bilinear(linear(picture), x, y)
    return srgb(out)


def psnr(a, b):
    return 10 * np.log10(255**2 / np.mean((np.asarray(a, float) - np.asarray(b, float)) ** 2))
