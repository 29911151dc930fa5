// A frame of a scene with several frames in flight; writes the last one as PPM.
//   c++ -std=c++17 process.cpp $(pkg-config --cflags --libs shutterbug) && ./a.out demo/capture out.ppm
#include <shutterbug.h>

#include <deque>
#include <fstream>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

static void must(shutterbug_status status, const void *handle) {
    if (status == SHUTTERBUG_OK) return;
    std::string text(shutterbug_last_error(handle, nullptr, 0) + 1, '\0');
    shutterbug_last_error(handle, text.data(), text.size());
    throw std::runtime_error(std::string(shutterbug_status_text(status)) + ": " + text);
}

struct Destroy {
    void operator()(shutterbug_engine *e) const { shutterbug_engine_destroy(e); }
    void operator()(shutterbug_frame *f) const { shutterbug_frame_destroy(f); }
};
template <class T> T sized() { T value{}; value.struct_size = sizeof(T); return value; }

int main(int argc, char **argv) try {
    auto options = sized<shutterbug_engine_options>();
    options.method = SHUTTERBUG_METHOD_PAPER;
    options.samples = 4;
    options.frames_in_flight = 3;
    shutterbug_engine *made = nullptr;
    must(shutterbug_engine_create(&options, &made), nullptr);
    std::unique_ptr<shutterbug_engine, Destroy> engine(made);
    must(shutterbug_engine_load_capture(made, argc > 1 ? argv[1] : "demo/capture"), made);
    auto info = sized<shutterbug_engine_info>();
    must(shutterbug_engine_get_info(made, &info), made);

    std::deque<std::unique_ptr<shutterbug_frame, Destroy>> in_flight;
    auto request = sized<shutterbug_request>();
    for (; request.frame_index < 5; ++request.frame_index, request.time_s += 1.0 / 30) {
        if (in_flight.size() == options.frames_in_flight) in_flight.pop_front(); // waits for the oldest
        shutterbug_frame *frame = nullptr;
        must(shutterbug_engine_submit(made, &request, &frame), made);
        in_flight.emplace_back(frame);
    }
    std::vector<char> pixels(std::size_t(3) * info.width * info.height);
    auto image = sized<shutterbug_image>();
    image.format = SHUTTERBUG_RGB8;
    image.width = info.width, image.height = info.height;
    image.stride_bytes = 3 * info.width, image.capacity_bytes = pixels.size(), image.pixels = pixels.data();
    while (in_flight.size() > 1) in_flight.pop_front();
    must(shutterbug_frame_wait(in_flight.back().get(), -1), in_flight.back().get());
    must(shutterbug_frame_read(in_flight.back().get(), SHUTTERBUG_PICTURE, &image), in_flight.back().get());
    std::ofstream(argc > 2 ? argv[2] : "out.ppm", std::ios::binary)
        << "P6\n" << info.width << " " << info.height << "\n255\n" << std::string(pixels.begin(), pixels.end());
} catch (const std::exception &error) { std::cerr << error.what() << "\n"; return 1; }
