//! Triangles as they are drawn: whole, and cut for the motion of the frames that draw them.
//!
//! Frames that were announced are sorted by how strongly the camera moves, in classes of a factor of two, and each
//! class has a cut of its own: one frame of strong acceleration would otherwise make every other frame draw its
//! triangles. Frames whose blur hides it are cut more coarsely. A frame that nobody announced is drawn with triangles
//! cut for the whole trajectory.

use super::ExactOptions;
use super::cut::{Limits, Views, cut, strength};
use crate::engine::scene::Stage;
use crate::error::{Result, counted};
use crate::gpu::Buffer;
use crate::raster::{Geometry, Mesh, MotionGroups, Place, PlaceInput};

/// Spans that differ by less are the same frame's, s.
const SAME_S: f64 = 1e-9;
/// An edge that lies further beside its place is worth a warning, px.
const VISIBLE_PX: f64 = 0.5;

/// Triangles, bound to the knots of each frame in flight.
pub(super) struct Placeable {
    pub(super) groups: Vec<PlaceInput>,
    pub(super) geometry: Geometry,
}

impl Placeable {
    pub(super) fn new(stage: &Stage, place: &Place, knots: &[Buffer], mesh: &Mesh) -> Result<Self> {
        let geometry = Geometry::new(&stage.context, mesh)?;
        let groups = knots.iter().map(|k| place.bind(&stage.buffers, &geometry, k)).collect::<Result<_>>()?;
        Ok(Self { groups, geometry })
    }
}

/// How much farther chords may be from their curves where blur hides it: at twice the distance, ladder rows with blur
/// lose 0.1 to 0.5 dB (at four times, up to 2.7), and the raster takes up to a third less time.
const BLURRED: f64 = 2.0;

/// From the first line's start to the last line's end, s.
pub(super) type Span = (f64, f64);

struct Cut {
    /// Strength, and whether blur hides errors; `None`: any frame.
    class: Option<(i32, bool)>,
    placeable: Placeable,
}

/// All of a scene's cuts for one readout.
#[derive(Default)]
pub(super) struct Cuts {
    /// Longest readout that they are good for, s, and whether its lines are rows.
    lines: (f64, bool),
    cuts: Vec<Cut>,
    /// Frames that were announced, in order, with their classes at that readout.
    announced: Vec<(Span, i32)>,
}

/// What a cut is made from.
pub(super) struct Source<'a> {
    pub(super) place: &'a Place,
    pub(super) knots: &'a [Buffer],
    pub(super) mesh: &'a Mesh,
    pub(super) groups: &'a MotionGroups,
    pub(super) limits: Limits,
}

impl Cuts {
    /// For frames of these spans.
    pub(super) fn new(mut frames: Vec<Span>) -> Self {
        frames.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        frames.dedup();
        Self { announced: frames.into_iter().map(|span| (span, 0)).collect(), ..Self::default() }
    }

    /// Drops all cuts. New ones are made for the readout of the next frame and for shorter ones.
    pub(super) fn forget(&mut self) {
        self.cuts.clear();
        self.lines = Default::default();
    }

    /// Triangles for a frame; `None` where they are to be made.
    pub(super) fn of(&self, (span, blurred): (Span, bool), lines: (f64, bool)) -> Option<&Placeable> {
        if lines.0 > self.lines.0 * (1.0 + 1e-9) || lines.1 != self.lines.1 {
            return None;
        }
        let class = self.class_of(span).map(|strength| (strength, blurred));
        let found = self.cuts.iter().find(|c| c.class == class);
        found.map(|c| &c.placeable)
    }

    /// Of a frame that was announced.
    fn class_of(&self, (from_s, to_s): Span) -> Option<i32> {
        let first = self.announced.partition_point(|((from, _), _)| *from < from_s - SAME_S);
        let near = self.announced[first..].iter().take_while(|((from, _), _)| *from <= from_s + SAME_S);
        // A shorter readout or exposure than announced lies inside.
        near.filter(|((_, to), _)| *to >= to_s - SAME_S).map(|(_, class)| *class).max()
    }

    /// Makes what [`Self::of`] asks for.
    pub(super) fn make(
        &mut self,
        stage: &Stage,
        source: &Source<'_>,
        (span, blurred): (Span, bool),
        lines: (f64, bool),
    ) -> Result<()> {
        if lines.0 > self.lines.0 * (1.0 + 1e-9) || lines.1 != self.lines.1 {
            self.cuts.clear();
            self.lines = lines;
            for (span, class) in &mut self.announced {
                *class = strength(stage, source.groups, *span, lines.0, source.limits.chord_px);
            }
        }
        let class = self.class_of(span).map(|strength| (strength, blurred));
        let of_class =
            self.announced.iter().filter(|(_, c)| class.is_none_or(|(strength, _)| *c == strength));
        // Of what was not announced nothing counts here: a frame is not to depend on which was asked for first.
        let frames: Vec<Span> = of_class.map(|(span, _)| *span).collect();
        let views = Views { frames: &frames, everywhere: class.is_none() };
        let mut limits = source.limits;
        if class.is_some_and(|(_, blurred)| blurred) {
            limits.chord_px *= BLURRED;
        }
        let (mesh, chord_px) = cut(stage, source.groups, source.mesh, &views, self.lines, limits);
        let (from, to) = (source.mesh.triangle_count(), mesh.triangle_count());
        tracing::info!(
            "{from} triangles cut into {to} for {} and a readout of {} s: {chord_px} px at most",
            counted(frames.len(), "frame", "frames"),
            self.lines.0
        );
        // Who asks for fewer triangles than there are by default has asked for coarser edges.
        if chord_px > VISIBLE_PX && limits.most >= ExactOptions::default().most_triangles as usize {
            tracing::warn!(
                "edges may lie {chord_px} px beside where the shutter and the lens put them: {to} triangles are as \
                 many as are made of {from}"
            );
        }
        let placeable = Placeable::new(stage, source.place, source.knots, &mesh)?;
        self.cuts.push(Cut { class, placeable });
        Ok(())
    }
}
