//! The network as a configuration.

use crate::Error;
use crate::shape::BlockShape;
use serde::{Deserialize, Serialize};

/// One block: convolution (stride 1, no padding), ReLU, max pooling, batch normalisation.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Block {
    /// Number of filters, 1..=256.
    pub channels: usize,
    /// Height (mel bands) and width (frames) of the filters, 1..=5.
    pub kernel: [usize; 2],
    /// Height and width of the pool, 1..=4.
    pub pool: [usize; 2],
}

/// How the planes of the last block reach the dense layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Summary {
    /// All of them (the paper).
    Flatten,
    /// Their mean over time: what the room sounds like does not depend on when.
    TimeMean,
}

/// The network: blocks, then dense layers.
///
/// ```
/// use sabine_estimator::NetworkConfig;
/// // The network of the code that Tang et al. released has 18,152 parameters with its 8 outputs.
/// let released = NetworkConfig { outputs: 8, ..NetworkConfig::small() };
/// assert_eq!(released.parameter_count()?, 18_152);
/// # Ok::<(), sabine_estimator::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NetworkConfig {
    /// Mel bands of the features.
    pub mels: usize,
    /// Frames of a window.
    pub frames: usize,
    /// The blocks.
    pub blocks: Vec<Block>,
    /// How their output is summarised.
    pub summary: Summary,
    /// Whether the mean and the deviation over time of each mel band go to the dense layers as well: the long-term spectrum,
    /// which the equalisation is read from.
    pub spectrum: bool,
    /// Units of a hidden dense layer with ReLU, if any.
    pub hidden: Option<usize>,
    /// Share of the inputs of the dense layers that is dropped in training, 0..1.
    pub dropout: f64,
    /// Number of outputs.
    pub outputs: usize,
}

impl NetworkConfig {
    /// Convolutions of the code released with Tang et al. (2020), flattened, no hidden layer: 18,152 parameters with 8 outputs.
    pub fn small() -> Self {
        let block = |channels, kernel, pool| Block { channels, kernel, pool };
        Self {
            mels: 32,
            frames: 499,
            blocks: vec![
                block(8, [1, 2], [1, 2]),
                block(8, [1, 2], [1, 2]),
                block(16, [1, 2], [1, 2]),
                block(16, [1, 2], [1, 2]),
                block(32, [2, 2], [2, 2]),
                block(32, [2, 2], [2, 2]),
            ],
            summary: Summary::Flatten,
            spectrum: false,
            hidden: None,
            dropout: 0.5,
            outputs: 13,
        }
    }

    /// The same with the hidden layer of 64 units that the paper's text describes: over 94,000 parameters.
    pub fn dense64() -> Self {
        Self { hidden: Some(64), ..Self::small() }
    }

    /// The same convolutions averaged over time, joined by the long-term spectrum, and a hidden layer of 64 units.
    pub fn averaged() -> Self {
        Self { summary: Summary::TimeMean, spectrum: true, hidden: Some(64), dropout: 0.2, ..Self::small() }
    }

    /// Checks the configuration.
    ///
    /// # Errors
    /// [`Error::Config`] naming the field.
    pub fn check(&self) -> Result<(), Error> {
        let range = |field, value: usize, low, high, range| {
            if (low..=high).contains(&value) {
                Ok(())
            } else {
                Err(Error::Config { field, value: value as f64, range })
            }
        };
        range("mels", self.mels, 1, 512, "1 to 512")?;
        range("frames", self.frames, 1, 100_000, "1 to 100,000")?;
        range("blocks", self.blocks.len(), 1, 16, "1 to 16")?;
        range("outputs", self.outputs, 1, 1024, "1 to 1024")?;
        range("hidden", self.hidden.unwrap_or(1), 1, 4096, "1 to 4096")?;
        for block in &self.blocks {
            range("channels", block.channels, 1, 256, "1 to 256")?;
            for side in block.kernel {
                range("kernel", side, 1, 5, "1 to 5")?;
            }
            for side in block.pool {
                range("pool", side, 1, 4, "1 to 4")?;
            }
        }
        if !(0.0..1.0).contains(&self.dropout) {
            return Err(Error::Config {
                field: "dropout",
                value: self.dropout,
                range: "0 or more and below 1",
            });
        }
        for shape in self.unchecked_shapes() {
            let (rows, columns) = shape.pooled();
            range("rows and columns left after pooling", rows.min(columns), 1, usize::MAX, "1 or more")?;
        }
        Ok(())
    }

    /// Number of trainable parameters.
    ///
    /// # Errors
    /// As [`NetworkConfig::check`].
    pub fn parameter_count(&self) -> Result<usize, Error> {
        Ok(self
            .parameter_shapes()?
            .iter()
            .filter(|(name, _)| !is_running(name))
            .map(|(_, shape)| shape.iter().product::<usize>())
            .sum())
    }

    /// Names and shapes of all tensors, running moments included, in a fixed order.
    ///
    /// # Errors
    /// As [`NetworkConfig::check`].
    pub fn parameter_shapes(&self) -> Result<Vec<(String, Vec<usize>)>, Error> {
        self.check()?;
        let mut shapes = Vec::new();
        for (i, block) in self.shapes().iter().enumerate() {
            let name = |part: &str| format!("block{}.{part}", i + 1);
            shapes.push((
                name("conv.weight"),
                vec![block.outputs, block.inputs, block.kernel.0, block.kernel.1],
            ));
            shapes.push((name("conv.bias"), vec![block.outputs]));
            for part in ["norm.scale", "norm.shift", "norm.running_mean", "norm.running_variance"] {
                shapes.push((name(part), vec![block.outputs]));
            }
        }
        let mut inputs = self.summary_len();
        if let Some(hidden) = self.hidden {
            shapes.push(("hidden.weight".into(), vec![hidden, inputs]));
            shapes.push(("hidden.bias".into(), vec![hidden]));
            inputs = hidden;
        }
        shapes.push(("output.weight".into(), vec![self.outputs, inputs]));
        shapes.push(("output.bias".into(), vec![self.outputs]));
        Ok(shapes)
    }

    /// Number of values that reach the dense layers.
    pub(crate) fn summary_len(&self) -> usize {
        self.block_summary_len() + if self.spectrum { 2 * self.mels } else { 0 }
    }

    /// Those of them that come from the last block.
    pub(crate) fn block_summary_len(&self) -> usize {
        self.shapes().last().map_or(0, |last| match self.summary {
            Summary::Flatten => last.output_len(),
            Summary::TimeMean => last.outputs * last.pooled().0,
        })
    }

    /// Sizes of the blocks of a checked configuration.
    pub(crate) fn shapes(&self) -> Vec<BlockShape> {
        self.unchecked_shapes()
    }

    fn unchecked_shapes(&self) -> Vec<BlockShape> {
        let mut input = (1, self.mels, self.frames);
        let shape = |block: &Block| {
            let shape = BlockShape {
                inputs: input.0,
                height: input.1,
                width: input.2,
                outputs: block.channels,
                kernel: (block.kernel[0], block.kernel[1]),
                pool: (block.pool[0], block.pool[1]),
            };
            let (rows, columns) = shape.pooled();
            input = (block.channels, rows, columns);
            shape
        };
        self.blocks.iter().map(shape).collect()
    }
}

/// Whether a tensor is a running moment rather than trained.
pub(crate) fn is_running(name: &str) -> bool {
    name.contains(".running_")
}
