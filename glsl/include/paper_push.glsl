// Members of a push-constant block: what the paper's gather is told. Twin: `Push` of src/reference/paper_gather.rs,
// which says what each means.
    uvec2 size;
    ivec2 margin_px;
    float start_s;
    float readout_time_s;
    float exposure_time_s;
    float frame_interval_s;
    float first_motion_s;
    float motion_step_s;
    uint motion_count;
    uint scan_order;
    uint max_samples;
    uint pixel_time;
