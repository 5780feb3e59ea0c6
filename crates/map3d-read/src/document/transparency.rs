//! Decides for a whole file whether its transparency is opacity: some exporters write 1 for opaque, so that walls vanish.

use map3d_base::Reason;
use serde::Deserialize;

use super::report_builder::ReportBuilder;

/// How the transparency of materials is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Transparency {
    AsIs,
    /// Opacity is one minus the opacity as written.
    Inverted,
    /// Inverted in files whose materials are all at least half transparent, at least one of them fully.
    #[default]
    Auto,
}

/// Counts the materials of a file by their transparency as written.
#[derive(Clone, Copy, Debug, Default)]
pub struct TransparencyCounts {
    materials: u64,
    /// At least half transparent.
    faint: u64,
    invisible: u64,
}

impl TransparencyCounts {
    /// `transparency`: 0 (opaque) to 1; `None` for a material that does not state it, which is opaque.
    pub fn add(&mut self, transparency: Option<f32>) {
        let transparency = transparency.unwrap_or(0.0);
        self.materials += 1;
        self.faint += u64::from(transparency >= 0.5);
        self.invisible += u64::from(transparency >= 1.0);
    }

    /// Returns true if the file's transparency is read as opacity, and reports it where the file decides.
    pub fn is_inverted(&self, option: Transparency, report: &mut ReportBuilder) -> bool {
        let seems_inverted = self.invisible > 0 && self.faint == self.materials;
        match option {
            Transparency::AsIs => false,
            Transparency::Inverted => true,
            Transparency::Auto => {
                if seems_inverted {
                    let (invisible, materials) = (self.invisible, self.materials);
                    report.note(
                        Reason::TransparencyReadAsOpacity,
                        format!("{invisible} of {materials} materials would be invisible, and none opaque; --transparency as-is draws them so"),
                    );
                }
                seems_inverted
            }
        }
    }
}

/// Reports invisible parts of a file whose transparency is read as written.
pub fn report_invisible(count: u64, inverted: bool, report: &mut ReportBuilder) {
    if count > 0 {
        let other = if inverted { "as-is" } else { "inverted" };
        report.note(Reason::TransparentSurfacesNotDrawn, format!("{count}; --transparency {other} draws them"));
    }
}
