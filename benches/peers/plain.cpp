// The chain in plain C++: remap, blur with a count that follows the path, Box-Muller noise. One loop, no intrinsics.
//   g++ -O3 -march=native -ffast-math -fopenmp plain.cpp -o plain
//   OMP_NUM_THREADS=2 ./plain FOLDER WIDTH HEIGHT MARGIN SIGMA REPEATS
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

static int width, height, margin, columns, rows;

template <class T>
static std::vector<T> read(const std::string& path, size_t count) {
    std::vector<T> values(count);
    FILE* file = fopen(path.c_str(), "rb");
    if (!file || fread(values.data(), sizeof(T), count, file) != count) {
        fprintf(stderr, "cannot read %s\n", path.c_str());
        exit(1);
    }
    fclose(file);
    return values;
}

static float integral(float v0, float v1, float knot) {
    float h = std::min(std::max(knot, 0.0f), 1.0f);
    return h * (v0 + 0.5f * h * (v1 - v0)) + std::max(knot - 1.0f, 0.0f) * v1;
}

static uint32_t next(uint32_t& s) {
    s ^= s << 13, s ^= s >> 17, s ^= s << 5;
    return s;
}

static float normal(uint32_t& s) {
    float u = (next(s) + 1.0f) * 2.3283064e-10f, a = next(s) * 1.4629181e-9f;
    return std::sqrt(-2.0f * std::log(u)) * std::cos(a);
}

static void chain(const uint8_t* color, const float* v0, const float* v1, float sigma, int most, bool adaptive,
                  uint8_t* out) {
#pragma omp parallel for schedule(dynamic, 8)
    for (int y = 0; y < height; ++y) {
        float f = float(y) / height;
        uint32_t state = 2463534242u + 7919u * y;
        for (int x = 0; x < width; ++x) {
            int here = 2 * ((y + margin) * columns + x + margin);
            float px = x + margin - (f - 0.5f) * (v0[here] + f * (v1[here] - v0[here]));
            float py = y + margin - (f - 0.5f) * (v0[here + 1] + f * (v1[here + 1] - v0[here + 1]));
            int tx = std::min(std::max(int(px + 0.5f), 0), columns - 1);
            int ty = std::min(std::max(int(py + 0.5f), 0), rows - 1);
            const float *a = v0 + 2 * (ty * columns + tx), *b = v1 + 2 * (ty * columns + tx);
            float bx = integral(a[0], b[0], f), by = integral(a[1], b[1], f);
            float mx = integral(a[0], b[0], f + 0.5f) - bx, my = integral(a[1], b[1], f + 0.5f) - by;
            float wx = integral(a[0], b[0], f + 1.0f) - bx, wy = integral(a[1], b[1], f + 1.0f) - by;
            float path = std::sqrt(mx * mx + my * my) + std::sqrt((wx - mx) * (wx - mx) + (wy - my) * (wy - my));
            int n = adaptive ? std::max(1, std::min(most, int(std::ceil(path - 0.001f)))) : most;
            float ax = 4 * mx - wx, ay = 4 * my - wy, cx = 2 * wx - 4 * mx, cy = 2 * wy - 4 * my;
            float sum[3] = {0, 0, 0};
            for (int i = 0; i < n; ++i) {
                float u = (i + 0.5f) / n;
                float sx = px - u * (ax + u * cx), sy = py - u * (ay + u * cy);
                int ix = std::min(std::max(int(sx), 0), columns - 2), iy = std::min(std::max(int(sy), 0), rows - 2);
                float kx = sx - ix, ky = sy - iy;
                const uint8_t* c = color + 4 * (iy * columns + ix);
                for (int k = 0; k < 3; ++k) {
                    float upper = c[k] + kx * (c[k + 4] - c[k]);
                    float lower = c[k + 4 * columns] + kx * (c[k + 4 * columns + 4] - c[k + 4 * columns]);
                    sum[k] += upper + ky * (lower - upper);
                }
            }
            for (int k = 0; k < 3; ++k) {
                float value = sum[k] / n + (sigma > 0 ? sigma * normal(state) : 0.0f) + 0.5f;
                out[3 * (y * width + x) + k] = uint8_t(std::min(std::max(value, 0.0f), 255.0f));
            }
        }
    }
}

int main(int count, char** argument) {
    if (count != 7) return fprintf(stderr, "usage: plain FOLDER WIDTH HEIGHT MARGIN SIGMA REPEATS\n"), 2;
    std::string folder = argument[1];
    width = atoi(argument[2]), height = atoi(argument[3]), margin = atoi(argument[4]);
    float sigma = 255.0f * atof(argument[5]);
    int repeats = atoi(argument[6]);
    columns = width + 2 * margin, rows = height + 2 * margin;
    size_t texels = size_t(columns) * rows;
    auto color = read<uint8_t>(folder + "/color.raw", 4 * texels);
    std::vector<uint8_t> out(3 * size_t(width) * height);
    for (const char* motion : {"moving", "tenth"}) {
        auto v0 = read<float>(folder + "/" + motion + "_0.raw", 2 * texels);
        auto v1 = read<float>(folder + "/" + motion + "_1.raw", 2 * texels);
        for (bool adaptive : {true, false}) {
            const char* name = adaptive ? "plain" : "plain_fixed";
            chain(color.data(), v0.data(), v1.data(), 0, 240, adaptive, out.data());
            FILE* file = fopen((folder + "/" + name + "_" + motion + "_240.out").c_str(), "wb");
            fwrite(out.data(), 1, out.size(), file);
            fclose(file);
            printf("{\"name\": \"%s\", \"motion\": \"%s\", \"samples\": 240, \"ms\": [", name, motion);
            for (int i = 0; i < repeats; ++i) {
                auto start = std::chrono::steady_clock::now();
                chain(color.data(), v0.data(), v1.data(), sigma, 240, adaptive, out.data());
                std::chrono::duration<double, std::milli> ms = std::chrono::steady_clock::now() - start;
                printf("%s%f", i ? ", " : "", ms.count());
            }
            printf("]}\n");
        }
    }
}
