//! Pages an engineer would forward: figures, tables and sentences in one self-contained file.
//!
//! A [`figure`] is plain data and becomes SVG; a [`mod@page`] is made of sections that hold
//! figures, tables and key numbers; `demo` is the page of one simulated design. Nothing here
//! needs a network or a script, and one file reads well in light, in dark, on a phone and on paper.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use report::{Source, documentation, summary};
//!
//! let loaded = design_file::read("../../examples/paper.toml".as_ref())?;
//! let (request, source) = Source::split(loaded);
//! let made = source.made(ftc_design::assembly::assemble(request)?);
//! println!("{}", summary::text(&made.design, &made.warnings));
//! let runs = documentation::runs(&made.design);
//! let page = documentation::page(&made.design, &runs, None, "Paper".into(), String::new());
//! assert!(page.contains("<svg"));
//! # Ok(())
//! # }
//! ```
//!
//! SVG is written with the same template crate as the page. One plotting crate (kuva) was tried, one
//! (poloto) was only read about, and one (plotters) was ruled out as no longer kept up. By that, none
//! lets colours follow the reader's scheme *and* leaves a gap where a sensor gives no number
//! *and* gives ids that stay unique when twenty figures share a page; two of the three also fix the
//! size in pixels and spend a third of a phone's width on the legend.

pub mod as_printed;
mod axis;
pub mod connection;
mod decimate;
mod demo;
pub mod documentation;
pub mod estimate;
pub mod figure;
pub mod identification;
mod made;
pub mod page;
pub mod robustness;
pub mod running_loop;
pub mod simulate;
pub mod style;
pub mod summary;
mod svg;
pub mod table;
pub mod text;
pub mod warnings;

pub use demo::{Digest, Scene, events, files, page};
pub use made::{Made, Source};

#[cfg(test)]
mod tests;
