/* Part of calls.c: frames with poses over them, what is asked beside frames, and pictures of more than 8 bits. Only
 * ever `aside`. */
/* An engine that stays, whose camera has a mosaic and margins to ask for; none of the handles that are picked. */
static shutterbug_engine *lasting(void) {
    static shutterbug_engine *engine;
    if (!engine) {
        shutterbug_engine_options options = {.struct_size = sizeof options, .samples = 1};
        if (shutterbug_engine_create(&options, &engine)) fail("no engine that lasts");
        if (shutterbug_engine_set_camera_text(
                engine, "width = 16\nheight = 12\nfx = 12\nfy = 12\ncx = 8\ncy = 6\nframe_period_s = 0.04\n"
                        "[rolling_shutter]\nreadout_time_s = 0.02\n[motion_blur]\nexposure_time_s = 0.004\n"
                        "[bayer_mosaic]\npattern = \"GRBG\"\n[quantization]\nbits = 12"))
            fail("no camera that lasts");
    }
    return engine;
}

/* The formats of more than 8 bits, by their own and other planes. */
static unsigned long finer_reads;
static void read_finer(shutterbug_frame *frame, const uint32_t *size, int kind) {
    static const uint32_t eighths[] = {48, 64, 16, 16, 16, 16, 10, 12, 14};
    uint32_t format = byte() % 9, plane = one_in(16) ? byte() % 8 : format < 2 ? 1 : 6;
    SIZED(shutterbug_image, to);
    to.format = 13 + format;
    if (one_in(12)) to.format = one_in(2) ? 4 + byte() % 2 : to.format | 0x10000;
    to.width = one_in(16) ? number(40) : size[0], to.height = one_in(16) ? number(40) : size[1];
    uint64_t row = (uint64_t)size[0] * eighths[format] / 8;
    to.stride_bytes = one_in(32) ? (uint64_t)word() << byte() % 33 : row + (one_in(4) ? 2 * (byte() % 20) : 0);
    to.capacity_bytes = to.stride_bytes * (size[1] ? size[1] - 1 : 0) + row;
    if (to.capacity_bytes > BYTES || one_in(16)) to.capacity_bytes = byte() * 16;
    to.pixels = one_in(40) ? NULL : ends[2] - to.capacity_bytes;
    if (one_in(40)) to.memory = any_handle(MEMORY);
    finer_reads += seen(5, shutterbug_frame_read(frame, plane, &to), frame, kind) == SHUTTERBUG_OK;
}

/* Depth with poses over the frame, several pictures, bodies; read in any format, and gone again. */
static void submit_path(shutterbug_engine *engine, const uint32_t *of_engine) {
    uint32_t own[2] = {16, 12};
    const uint32_t *size = one_in(2) ? of_engine : own;
    int kind = size == own ? -1 : ENGINE;
    if (size == own) engine = lasting();
    SIZED(shutterbug_outside, o);
    SIZED(shutterbug_depth_convention, of_depth);
    /* Other kinds of frames are other kernels, which a software device takes long to make. */
    uint32_t margin[2] = {8, one_in(12) ? byte() % 9 : 8}, w = size[0] + 2 * margin[0], h = size[1] + 2 * margin[1];
    shutterbug_image color = image(1 + byte() % 5, w, h, 0), depth = image(SHUTTERBUG_R32F, w, h, 1);
    shutterbug_image ids = image(9 + byte() % 3, w, h, 0);
    shutterbug_stamped_pose poses[20];
    shutterbug_body bodies[4];
    shutterbug_picture pictures[8];
    double step_s = one_in(16) ? real() : 0.005, turn = one_in(8) ? real() : 0.01;
    for (int i = 0; i < 20; ++i) {
        shutterbug_stamped_pose pose = {i * step_s, {{i * turn, 0, 0}, {0, 0, 0, 1}}};
        poses[i] = pose;
    }
    if (one_in(12)) poses[byte() % 20].time_s = real();
    if (one_in(12)) poses[byte() % 20].world_from_camera.rotation_xyzw[byte() % 4] = real();
    for (int i = 0; i < 4; ++i) {
        shutterbug_body body = {one_in(12) ? 1 : (uint32_t)i + 64, one_in(16) ? byte() % 3 : 20, one_in(40) ? NULL : poses};
        bodies[i] = body;
    }
    for (int i = 0; i < 8; ++i) {
        shutterbug_picture picture = {one_in(16) ? real() : 0.003 * (i + 1), one_in(40) ? NULL : &color,
                                      one_in(40) ? NULL : &depth, one_in(40) ? NULL : &ids};
        pictures[i] = picture;
    }
    of_depth.kind = number(6), of_depth.near_m = one_in(8) ? real() : 0.1, of_depth.far_m = one_in(8) ? real() : 100;
    o.frame_index = byte(), o.time_s = one_in(16) ? real() : 0.01, o.color_time_s = one_in(16) ? real() : 0.02;
    o.encoding = number(2), o.margin_x_px = margin[0], o.margin_y_px = margin[1];
    o.flags = one_in(40) ? word() : byte() % 16, o.nearest_m = one_in(4) ? real() : 0;
    o.color = one_in(40) ? NULL : &color, o.depth = one_in(40) ? NULL : &depth, o.depth_convention = &of_depth;
    o.poses = one_in(40) ? NULL : poses, o.pose_count = one_in(24) ? byte() % 3 : 20;
    o.ids = one_in(40) ? NULL : &ids, o.bodies = one_in(40) ? NULL : bodies, o.body_count = one_in(6) ? byte() % 5 : 2;
    o.pictures = one_in(40) ? NULL : pictures, o.picture_count = one_in(12) ? byte() % 8 : 0;
    o.reserved_more = one_in(64);
    shutterbug_frame *frame = NULL;
    shutterbug_status status = seen(2, shutterbug_engine_submit_outside(engine, &o, &frame), engine, kind);
    if ((status == SHUTTERBUG_OK) != (frame != NULL)) fail("a path: status %d with frame %p", status, (void *)frame);
    if (!frame) return;
    if (!one_in(16) && !seen(4, shutterbug_frame_wait(frame, -1), frame, -1))
        for (int i = 0; i < 3; ++i) read_finer(frame, size, -1);
    seen(17, shutterbug_frame_destroy(frame), frame, -1);
}

/* Margins, poses and whether two frames agree; sentences end before a guarded page. */
static void ask(shutterbug_engine *engine) {
    SIZED(shutterbug_motion_bound, bound);
    uint32_t x = 7, y = 7;
    bound.turn_rate_rad_s = one_in(8) ? real() : 2, bound.speed_m_s = one_in(8) ? real() : 0;
    bound.nearest_m = one_in(4) ? real() : 0, bound.color_delay_s = one_in(8) ? real() : 0.01;
    int own = one_in(2);
    if (own) engine = lasting();
    seen(30, shutterbug_engine_margin(engine, one_in(40) ? NULL : &bound, one_in(40) ? NULL : &x, &y), engine, own ? -1 : ENGINE);

    double values[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    uint64_t room = byte();
    char *text = one_in(8) ? NULL : (char *)ends[0] - room;
    SIZED(shutterbug_pose_convention, convention);
    shutterbug_pose pose;
    convention.form = number(5), convention.axes = number(4), convention.direction = number(3);
    convention.metres = one_in(4) ? real() : 0;
    if (convention.form < 2) values[convention.form ? 3 : 6] = 1, values[0] = 0;
    if (one_in(8)) values[byte() % 16] = real();
    seen(28, shutterbug_pose_convert(&convention, one_in(40) ? NULL : values, one_in(40) ? NULL : &pose, text, text ? room : 0), NULL,
         -1);

    SIZED(shutterbug_camera, camera);
    SIZED(shutterbug_depth_convention, of_depth);
    SIZED(shutterbug_agreement, agreement);
    camera.width = 1 + number(SIDE), camera.height = 1 + number(SIDE), camera.fx_px = camera.fy_px = one_in(16) ? real() : 12;
    camera.cx_px = camera.width / 2.0, camera.cy_px = camera.height / 2.0, camera.frame_period_s = 0.04;
    of_depth.kind = number(6), of_depth.near_m = 0.1, of_depth.far_m = 100;
    shutterbug_image color = image(1 + byte() % 5, camera.width, camera.height, 0);
    shutterbug_image depth = image(SHUTTERBUG_R32F, camera.width, camera.height, 1);
    shutterbug_view views[2];
    for (int i = 0; i < 2; ++i) {
        SIZED(shutterbug_view, view);
        view.color = one_in(40) ? NULL : &color, view.depth = one_in(40) ? NULL : &depth, view.depth_convention = &of_depth;
        view.encoding = number(2), view.world_from_camera.rotation_xyzw[3] = one_in(24) ? real() : 1;
        view.world_from_camera.translation_m[0] = real();
        views[i] = view;
    }
    seen(29, shutterbug_check_conventions(&camera, views, one_in(40) ? NULL : views + 1, &agreement, text, text ? room : 0), NULL, -1);
}
