//! `simulate --description DIR`: the scene and the path as a diagnosis corrected them.

use std::fs;
use std::path::{Path, PathBuf};

use shutterbug::camera::Trajectory;
use shutterbug::capture::Capture;
use shutterbug::chain::View;
use shutterbug::effects;
use shutterbug::engine::{Frame, FrameRequest};
use shutterbug::error::{Error, Result};
use shutterbug::plane::{COLOR_CHANNELS, read_exr_plane};
use shutterbug::reference::chain;

/// Name of the corrected path in the folder.
const TRAJECTORY_FILE: &str = "trajectory.tum";

/// Factors on the radiance of some frames.
pub(super) struct Description {
    folder: Option<PathBuf>,
}

impl Description {
    /// Takes the corrected path, if there is one, and finds the factors.
    ///
    /// # Errors
    /// A folder that holds neither; a path that cannot be read.
    pub(super) fn of(folder: Option<&Path>, capture: &mut Capture) -> Result<Self> {
        let Some(folder) = folder else { return Ok(Self { folder: None }) };
        let (path, factors) = (folder.join(TRAJECTORY_FILE), folder.join("scene_radiance"));
        if !path.exists() && !factors.is_dir() {
            let expected =
                "trajectory.tum or scene_radiance/NNNNNN.exr, as `shutterbug diagnose` writes them";
            return Err(Error::input(folder, None, "no corrected description", expected));
        }
        if path.exists() {
            let text = fs::read_to_string(&path).map_err(|e| Error::io(&path, "read", e))?;
            capture.trajectory = Trajectory::parse(&path, &text, capture.epoch_ns)?;
        }
        Ok(Self { folder: factors.is_dir().then_some(factors) })
    }

    /// Whether frames are developed anew.
    pub(super) fn relights(&self) -> bool {
        self.folder.is_some()
    }

    /// Develops a frame whose surfaces have factors anew, on the CPU.
    ///
    /// # Errors
    /// Factors that cannot be read or have another size than the frame.
    pub(super) fn relight(
        &self,
        frame: &mut Frame,
        requests: &[FrameRequest],
        view: View,
        stem: &str,
    ) -> Result<()> {
        let Some(folder) = &self.folder else { return Ok(()) };
        let path = folder.join(format!("{stem}.exr"));
        let (Some(radiance), true) = (&mut frame.radiance, path.exists()) else { return Ok(()) };
        let factor = read_exr_plane(&path, &COLOR_CHANNELS)?;
        if (factor.width, factor.height) != (radiance.width, radiance.height) {
            let found = format!("factors of {}x{} px", factor.width, factor.height);
            let expected = format!("{}x{} px, the size of the frames", radiance.width, radiance.height);
            return Err(Error::input(&path, None, found, expected));
        }
        for (l, f) in radiance.data.chunks_exact_mut(4).zip(factor.data.chunks_exact(3)) {
            (0..3).for_each(|c| l[c] *= f[c]);
        }
        let request = requests.iter().find(|r| r.index == frame.index).expect("it was asked for");
        frame.picture = chain::picture(effects::LIST, &request.settings, &view, radiance);
        Ok(())
    }
}
