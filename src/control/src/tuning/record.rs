//! A structure of numbers by name: in a record it is a map, and each number has its bounds.
//!
//! What `serde` derives for so many fields takes more room in an FMU than all other reading of a design.

use alloc::string::String;
use core::fmt;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserializer, Serializer};

/// A structure of numbers, each with its value by default and its bounds.
macro_rules! tuning {
    (
        $(#[$about:meta])*
        pub struct $name:ident {
            $($(#[$doc:meta])* $field:ident: $value:expr, $bounds:expr;)*
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[non_exhaustive]
        pub struct $name {
            $($(#[$doc])* pub $field: f64,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $value,)* }
            }
        }

        impl $name {
            const NAMES: &[&str] = &[$(stringify!($field)),*];
            const BOUNDS: &[[f64; 2]] = &[$($bounds),*];

            fn numbers(&self) -> [f64; Self::NAMES.len()] {
                [$(self.$field),*]
            }

            /// The first number beyond its bounds, or none.
            fn beyond_bounds(&self) -> Option<(&'static str, [f64; 2])> {
                let bounds = Self::NAMES.iter().zip(Self::BOUNDS);
                let numbers = bounds.zip(self.numbers());
                let mut beyond = numbers.filter(|((_, [least, most]), number)| {
                    !(*least..=*most).contains(number)
                });
                beyond.next().map(|((name, bounds), _)| (*name, *bounds))
            }
        }

        impl serde::Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                super::tuning::record::write(Self::NAMES, &self.numbers(), serializer)
            }
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let numbers = [f64::NAN; Self::NAMES.len()];
                let [$($field),*] = super::tuning::record::read(Self::NAMES, numbers, deserializer)?;
                Ok(Self { $($field),* })
            }
        }
    };
}
pub(super) use tuning;

pub(super) fn write<S: Serializer>(
    names: &[&str],
    numbers: &[f64],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(names.iter().zip(numbers))
}

/// The `numbers` of these names, each of which must be there once.
pub(super) fn read<'de, D: Deserializer<'de>, const N: usize>(
    names: &'static [&'static str],
    mut numbers: [f64; N],
    deserializer: D,
) -> Result<[f64; N], D::Error> {
    deserializer.deserialize_map(Numbers(names, &mut numbers))?;
    Ok(numbers)
}

struct Numbers<'a>(&'static [&'static str], &'a mut [f64]);

impl<'de> Visitor<'de> for Numbers<'_> {
    type Value = ();

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("the tuning constants by name")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let Self(names, numbers) = self;
        let mut found = 0;
        while let Some((name, number)) = map.next_entry::<String, f64>()? {
            let known = names.iter().position(|known| *known == name);
            let slot = known.and_then(|at| numbers.get_mut(at));
            let slot = slot.filter(|slot| slot.is_nan());
            *slot.ok_or_else(|| A::Error::custom("an unknown or repeated tuning constant"))? =
                number;
            found += 1;
        }
        match found == names.len() && numbers.iter().all(|number| !number.is_nan()) {
            true => Ok(()),
            false => Err(A::Error::custom(
                "a tuning constant is missing or no number",
            )),
        }
    }
}
