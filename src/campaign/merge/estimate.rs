//! Poses of all units: one results file, and one of posteriors where there is one.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use grip_sim::bop::results::HEADER;

use super::trials::parse;
use super::{Output, POSTERIORS, RESULTS, Sink, lines};
use crate::benchmark::PosteriorLine;
use crate::campaign::manifest::Unit;
use crate::campaign::unit::DoneFile;

pub(super) struct Estimate {
    results: Output,
    posteriors: Option<Output>,
}

impl Estimate {
    pub(super) fn begin(posteriors: bool, out: &Path) -> Result<Self> {
        let mut results = Output::create(out.join(RESULTS))?;
        results.line(HEADER)?;
        let posteriors = posteriors.then(|| Output::create(out.join(POSTERIORS))).transpose()?;
        Ok(Self { results, posteriors })
    }
}

impl Sink for Estimate {
    fn add(&mut self, unit: &Unit, done: &DoneFile, folder: &Path) -> Result<()> {
        let images = unit.images.as_ref().context("campaign.json: the unit says no images")?;
        ensure!(done.results == images.count as u64, "{} images, not {}", done.results, images.count);
        let path = folder.join(RESULTS);
        let mut last = images.first;
        let mut in_order = |image: [u32; 2]| {
            ensure!(
                last <= image && image <= images.last,
                "{}: scene {}, image {} is out of order, or no image of this unit",
                folder.display(),
                image[0],
                image[1]
            );
            last = image;
            Ok(())
        };
        let mut poses = lines(&path)?;
        let header = poses.next().transpose()?;
        ensure!(header.as_deref() == Some(HEADER), "{}: has no header", path.display());
        for line in poses {
            let line = line?;
            let mut numbers = line.split(',').map(str::parse);
            let (Some(Ok(scene)), Some(Ok(image))) = (numbers.next(), numbers.next()) else {
                anyhow::bail!("{}: a line is damaged", path.display());
            };
            in_order([scene, image])?;
            self.results.line(&line)?;
        }
        let Some(posteriors) = &mut self.posteriors else { return Ok(()) };
        let path = folder.join(POSTERIORS);
        for line in lines(&path)? {
            let line = line?;
            let PosteriorLine { scene_id, im_id, .. } = parse(&line, &path)?;
            ensure!(
                (images.first..=images.last).contains(&[scene_id, im_id]),
                "{}: scene {scene_id}, image {im_id} is no image of this unit",
                path.display()
            );
            posteriors.line(&line)?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.results.finish()?;
        self.posteriors.map_or(Ok(()), Output::finish)
    }
}
