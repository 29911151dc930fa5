// Calls examples/gazebo as Gazebo would, over the stand-ins beside this: a camera that turns to the left in front of far bars. A
// rolling shutter leans them; where the camera rests they stand.
//   drive camera.toml     exit code 0: the bars lean as far as they should; 77: no device
#include "../../../examples/gazebo/rolling_camera.cc"

#include <cstring>
#include <iostream>

namespace {
constexpr int W = 160, H = 120;
constexpr double RATE_RAD_S = 1.0, READOUT_S = 0.02, F = 150.0;

gz::msgs::Image message(int64_t nsec, gz::msgs::PixelFormatType format, const std::string &data, uint32_t step) {
    gz::msgs::Image image;
    image.mutable_header()->mutable_stamp()->set_sec(nsec / 1000000000);
    image.mutable_header()->mutable_stamp()->set_nsec(int32_t(nsec % 1000000000));
    image.set_width(W), image.set_height(H), image.set_step(step);
    image.set_pixel_format_type(format), image.set_data(data);
    return image;
}

// Column of the rising edge nearest to the middle in a row, px.
double edge(const std::string &rgb, int row) {
    for (int x = W / 2 - 20; x < W / 2 + 20; ++x) {
        const double a = uint8_t(rgb[3 * (row * W + x)]), b = uint8_t(rgb[3 * (row * W + x + 1)]);
        if (a < 128 && b >= 128) return x + (128 - a) / (b - a);
    }
    return -1000;
}

// How far the edge leans from the first line to the last, px, for a camera that turns so.
double lean(const char *camera, double rate_rad_s) {
    gz::transport::subscribers().clear();
    rolling_camera::RollingCamera system;
    auto element = std::make_shared<sdf::Element>();
    element->values = {{"topic", "eye"}, {"camera", camera}, {"readout_time_s", std::to_string(READOUT_S)}};
    gz::sim::EntityComponentManager components;
    gz::sim::EventManager events;
    double now_s = 0;
    components.pose = [&](gz::sim::Entity) {
        const double half = 0.5 * rate_rad_s * now_s; // about z, which is up: to the left
        return gz::math::Pose3d({0, 0, 1}, {std::cos(half), 0, 0, std::sin(half)});
    };
    system.Configure(7, element, components, events);
    std::vector<gz::msgs::Image> delivered;
    gz::transport::subscribers()["eye/delivered"].push_back([&](const gz::msgs::Image &i) { delivered.push_back(i); });

    std::string rgb(3 * W * H, '\x20'), depth(4 * W * H, '\0');
    for (int i = 0; i < W * H; ++i) {
        if (i % W >= W / 2) std::memset(&rgb[3 * i], 220, 3);
        const float far_m = 1000;
        std::memcpy(&depth[4 * i], &far_m, 4);
    }
    for (int step = 0; step <= 100; ++step) {
        now_s = 0.001 * step;
        gz::sim::UpdateInfo info;
        info.simTime = std::chrono::milliseconds(step);
        system.PostUpdate(info, components);
        if (step == 50) { // colour and depth come one after the other, with a colour alone before
            for (auto &call : gz::transport::subscribers()["eye/image"]) {
                call(message(40000000, gz::msgs::RGB_INT8, rgb, 3 * W));
                call(message(50000000, gz::msgs::RGB_INT8, rgb, 3 * W));
            }
            for (auto &call : gz::transport::subscribers()["eye/depth_image"]) call(message(50000000, gz::msgs::R_FLOAT32, depth, 4 * W));
        }
        if (step == 58 && !delivered.empty()) throw std::runtime_error("delivered before its last line has closed");
    }
    if (delivered.size() != 1 || delivered[0].header().stamp().nsec() != 50000000) throw std::runtime_error("one picture, of 50 ms, is expected");
    return edge(delivered[0].data(), H - 1) - edge(delivered[0].data(), 0);
}
} // namespace

int main(int, char **argv) try {
    auto options = rolling_camera::sized<shutterbug_engine_options>();
    shutterbug_engine *probe = nullptr;
    if (shutterbug_engine_create(&options, &probe) == SHUTTERBUG_NO_DEVICE) return 77;
    shutterbug_engine_destroy(probe);
    // To the left by RATE: what is far moves to the right by F RATE in a second; the last line is read one readout later.
    const double found = lean(argv[1], RATE_RAD_S), wanted = F * RATE_RAD_S * READOUT_S * (H - 1) / H, rest = lean(argv[1], 0);
    std::cout << "leans by " << found << " px, " << wanted << " expected; at rest " << rest << "\n";
    return std::abs(found - wanted) < 0.25 && std::abs(rest) < 0.02 ? 0 : 1;
} catch (const std::exception &error) { std::cerr << error.what() << "\n"; return 1; }
