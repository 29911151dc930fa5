//! What a report says beside its findings: what was not simulated, and what to do next.

use crate::diagnose::report::*;
use shutterbug::capture::Capture;
use shutterbug::chain::Settings;

/// What is said of a given camera with automatic exposure: frames are judged one by one and in parts, so that the
/// control, which needs all frames before, is not run; a gain that changes from frame to frame stays in the gap.
pub(crate) fn uncontrolled(given: &Settings) -> Option<String> {
    use shutterbug::chain::Effect as _;
    (shutterbug::effects::AutoExposure.variant(given) != 0).then(|| {
        "auto_exposure of the given camera is not simulated here (frames are judged one by one): all frames have \
         exposure_gain alone, and what the control changed from frame to frame counts as gap"
            .to_owned()
    })
}

/// Next steps after a comparison with another simulator's frames: footage that decides what is undetermined, at most
/// three.
pub(crate) fn next_of_pair(report: &Report) -> Vec<NextStep> {
    let undetermined = report.candidates.iter().filter(|c| c.state == CandidateState::Undetermined);
    let mut steps: Vec<NextStep> = Vec::new();
    for candidate in undetermined.filter(|c| !c.footage.is_empty()) {
        let purpose = format!("decide {}: supply {}", candidate.name, candidate.footage);
        if steps.len() < 3 {
            let command = "shutterbug diagnose --sim SIM --real REAL --out DIR".to_owned();
            steps.push(NextStep { purpose, command });
        }
    }
    steps
}

/// Next steps after the diagnosis of a capture.
pub(crate) fn next(report: &Report, capture: &Capture) -> Vec<NextStep> {
    let root = capture.root.display();
    let mut steps = Vec::new();
    if !report.effects.is_empty() {
        let corrected = report.effects.iter().any(|e| !e.camera);
        let description = if corrected { " --description DIR" } else { "" };
        steps.push(NextStep {
            purpose: "simulate with the effects found (DIR is this report's folder)".to_owned(),
            command: format!(
                "shutterbug simulate {root} --camera DIR/camera.toml{description} --method exact --out FRAMES"
            ),
        });
    }
    if report.candidates.iter().any(|c| c.state == CandidateState::Undetermined) {
        steps.push(NextStep {
            purpose: "decide what is undetermined: record the footage that it names, and diagnose that"
                .to_owned(),
            command: "shutterbug diagnose NEW_CAPTURE --out DIR".to_owned(),
        });
    }
    steps
}

/// Effects of the given camera that the simulation here leaves out.
pub(crate) fn not_simulated(capture: &Capture) -> Vec<String> {
    let known = &capture.camera.settings;
    let left_out = shutterbug::effects::LIST.iter().filter(|e| {
        let candidate = crate::diagnose::expect::model::CANDIDATES.iter().any(|c| c.name == e.id());
        known.has(e.id()) && !candidate && !known.is_neutral(e.id(), e.specs())
    });
    let said = |e: &&dyn shutterbug::chain::Effect| {
        match e.id() {
        "auto_exposure" => "camera.toml has [auto_exposure], which diagnose does not simulate: its gain changes from \
         frame to \
                            frame, and what it changes is part of the gap here. Record with the exposure locked, or \
                            take it \
                            out of camera.toml and look at where.by_frame"
            .to_owned(),
        name => {
            format!("camera.toml has [{name}], which diagnose does not simulate: what it does is part of the gap here")
        }
    }
    };
    left_out.map(said).collect()
}

#[cfg(test)]
mod tests {
    use super::uncontrolled;
    use shutterbug::chain::{Settings, Value};
    use shutterbug::effects::AutoExposure;

    #[test]
    fn a_camera_with_automatic_exposure_is_said_to_be_simulated_without() {
        let mut given = Settings::default();
        assert_eq!(uncontrolled(&given), None);
        given.set(&AutoExposure, "target", Value::Number(0.2)).expect("in range");
        assert!(
            uncontrolled(&given)
                .expect("said")
                .contains("auto_exposure of the given camera is not simulated")
        );
    }
}
