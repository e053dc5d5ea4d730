//! What changes at run time, as values: copied in place, and compared in shape.
//!
//! A copy in place allocates nothing, so a tick can be tried on a copy between two ticks. Shapes
//! are compared where a state comes from outside: on line, nothing else meets a wrong size.

/// A value that changes at run time.
pub trait State: Clone {
    /// Whether every vector has the length, and every constant the value, that `other` has.
    fn same_shape(&self, other: &Self) -> bool;
}

macro_rules! scalars {
    ($($scalar:ty),*) => {
        $(impl State for $scalar {
            fn same_shape(&self, _: &Self) -> bool {
                true
            }
        })*
    };
}

scalars!(f64, u32, bool);

impl<T: State> State for Vec<T> {
    fn same_shape(&self, other: &Self) -> bool {
        self.len() == other.len() && self.iter().zip(other).all(|(a, b)| a.same_shape(b))
    }
}

impl<T: State> State for Option<T> {
    fn same_shape(&self, other: &Self) -> bool {
        match (self, other) {
            (Some(a), Some(b)) => a.same_shape(b),
            (None, None) => true,
            _ => false,
        }
    }
}

/// Implements [`State`] and a `Clone` that copies in place: `parts` are states themselves,
/// `constants` never change, `counters` may have any value.
#[macro_export]
macro_rules! state {
    ($name:ident { parts: [$($part:ident),*], constants: [$($constant:ident),*], counters: [$($counter:ident),*] }) => {
        impl Clone for $name {
            fn clone(&self) -> Self {
                Self {
                    $($part: self.$part.clone(),)*
                    $($constant: self.$constant,)*
                    $($counter: self.$counter,)*
                }
            }

            fn clone_from(&mut self, source: &Self) {
                $(self.$part.clone_from(&source.$part);)*
                $(self.$constant = source.$constant;)*
                $(self.$counter = source.$counter;)*
            }
        }

        impl $crate::state::State for $name {
            fn same_shape(&self, other: &Self) -> bool {
                true $(&& $crate::state::State::same_shape(&self.$part, &other.$part))*
                    $(&& self.$constant == other.$constant)*
            }
        }
    };
}
