//! safetensors files of f32 and flag columns, with errors that name file and tensor.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::SacError;

/// Key of the one metadata entry, which holds JSON: a map's order would change from run to run.
const HEADER: &str = "palpate-sac";

/// Collects tensors, then writes them.
#[derive(Default)]
pub(crate) struct Writer {
    tensors: Vec<(String, Dtype, Vec<usize>, Vec<u8>)>,
}

impl Writer {
    pub(crate) fn new() -> Self {
        Self::default()
    }

    pub(crate) fn f32(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        let bytes = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.tensors.push((name.into(), Dtype::F32, shape.into(), bytes));
    }

    pub(crate) fn u8(&mut self, name: &str, shape: &[usize], values: &[u8]) {
        self.tensors.push((name.into(), Dtype::U8, shape.into(), values.into()));
    }

    pub(crate) fn save(&self, path: &Path, header: &impl Serialize) -> Result<(), SacError> {
        let malformed = |e: &dyn std::fmt::Display| SacError::checkpoint(path, e);
        let header = serde_json::to_string(header).map_err(|e| malformed(&e))?;
        let mut views = Vec::with_capacity(self.tensors.len());
        for (name, dtype, shape, bytes) in &self.tensors {
            views.push((
                name,
                TensorView::new(*dtype, shape.clone(), bytes).map_err(|e| malformed(&e))?,
            ));
        }
        let bytes = safetensors::serialize(views, Some(HashMap::from([(HEADER.into(), header)])))
            .map_err(|e| malformed(&e))?;
        std::fs::write(path, bytes).map_err(|source| SacError::Io { path: path.into(), source })
    }
}

/// A file in memory.
pub(crate) struct Reader {
    path: PathBuf,
    bytes: Vec<u8>,
}

impl Reader {
    pub(crate) fn open(path: &Path) -> Result<Self, SacError> {
        let bytes =
            std::fs::read(path).map_err(|source| SacError::Io { path: path.into(), source })?;
        let reader = Self { path: path.into(), bytes };
        reader.tensors()?;
        Ok(reader)
    }

    pub(crate) fn header<T: DeserializeOwned>(&self) -> Result<T, SacError> {
        let (_, metadata) =
            SafeTensors::read_metadata(&self.bytes).map_err(|e| self.malformed(&e))?;
        let text = metadata.metadata().as_ref().and_then(|m| m.get(HEADER));
        let text =
            text.ok_or_else(|| self.malformed(&format!("no \"{HEADER}\" in the metadata")))?;
        serde_json::from_str(text).map_err(|e| self.malformed(&e))
    }

    /// Whether there is such a tensor.
    pub(crate) fn has(&self, name: &str) -> Result<bool, SacError> {
        Ok(self.tensors()?.tensor(name).is_ok())
    }

    /// Length of a tensor along its first axis.
    pub(crate) fn rows(&self, name: &str) -> Result<usize, SacError> {
        let tensors = self.tensors()?;
        let view = tensors.tensor(name).map_err(|e| self.malformed(&e))?;
        view.shape()
            .first()
            .copied()
            .ok_or_else(|| self.malformed(&format!("{name} is a single number")))
    }

    /// The values of an f32 tensor; every one must be finite.
    pub(crate) fn f32(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, SacError> {
        let values: Vec<f32> = self
            .bytes(name, Dtype::F32, shape)?
            .as_chunks()
            .0
            .iter()
            .map(|b| f32::from_le_bytes(*b))
            .collect();
        match values.iter().position(|x| !x.is_finite()) {
            None => Ok(values),
            Some(i) => Err(self.malformed(&format!("{name}[{i}] is {}", values[i]))),
        }
    }

    /// The values of a tensor of flags; every one must be 0 or 1.
    pub(crate) fn u8(&self, name: &str, shape: &[usize]) -> Result<Vec<u8>, SacError> {
        let values = self.bytes(name, Dtype::U8, shape)?.to_vec();
        match values.iter().position(|x| *x > 1) {
            None => Ok(values),
            Some(i) => Err(self.malformed(&format!("{name}[{i}] is {}, not a flag", values[i]))),
        }
    }

    fn bytes(&self, name: &str, dtype: Dtype, shape: &[usize]) -> Result<&[u8], SacError> {
        let tensors = self.tensors()?;
        let view = tensors.tensor(name).map_err(|e| self.malformed(&e))?;
        if view.dtype() != dtype || view.shape() != shape {
            let (d, s) = (view.dtype(), view.shape());
            return Err(
                self.malformed(&format!("{name} is {d:?} {s:?}, expected {dtype:?} {shape:?}"))
            );
        }
        Ok(view.data())
    }

    fn tensors(&self) -> Result<SafeTensors<'_>, SacError> {
        SafeTensors::deserialize(&self.bytes).map_err(|e| self.malformed(&e))
    }

    pub(crate) fn malformed(&self, reason: &dyn std::fmt::Display) -> SacError {
        SacError::checkpoint(&self.path, reason)
    }
}
