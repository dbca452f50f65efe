//! The same work for many indices, on all threads where the feature `threads` is on.

/// What `compute` gives for each index below `count`, in order.
pub(crate) fn for_each_index<T: Send>(count: usize, compute: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    #[cfg(feature = "threads")]
    {
        use rayon::prelude::*;
        (0..count).into_par_iter().map(compute).collect()
    }
    #[cfg(not(feature = "threads"))]
    {
        (0..count).map(compute).collect()
    }
}
