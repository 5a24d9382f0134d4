//! A recipe: which variables a data packet holds, with what types and where.

use super::value::{DataType, Value, VariableReply};
use super::wire::Reader;

/// The variables of data packets with one id, typed as the controller announced them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recipe {
    id: u8,
    fields: Vec<Field>,
    size: usize,
}

/// One variable of a [`Recipe`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// Its type.
    pub data_type: DataType,
    /// Where its value starts among the values, bytes.
    pub offset: usize,
}

/// A recipe that the controller did not grant, or a packet that does not fit its recipe.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RecipeError {
    /// A different number of types than of names.
    #[error("the controller answers {names} variables with {types} types")]
    Count {
        /// Variables asked for.
        names: usize,
        /// Types returned.
        types: usize,
    },
    /// Variables that this controller does not have.
    #[error(
        "this controller has no variable {}: registers 24-47 need PolyScope 5.3 (3.9 on CB3), other names may need a newer one",
        .0.join(", ")
    )]
    NotFound(Vec<String>),
    /// Inputs that another client owns.
    #[error("{} owned by another client: {}", .0.join(", "), likely_owner(.0))]
    InUse(Vec<String>),
    /// All types were granted, the recipe was not.
    #[error("the controller refuses a recipe of {names} variables although it knows them all")]
    Refused {
        /// Variables asked for.
        names: usize,
    },
    /// A data packet that is longer or shorter than its recipe.
    #[error("a data packet holds {got} bytes of values, its recipe needs {want}")]
    Size {
        /// Bytes of the packet.
        got: usize,
        /// Bytes of the recipe.
        want: usize,
    },
}

/// Who usually holds the inputs that were asked for.
fn likely_owner(names: &[String]) -> &'static str {
    let register = |name: &String| -> Option<u32> {
        name.starts_with("input_").then(|| name.rsplit('_').next()?.parse().ok())?
    };
    let bit = |name: &String| name.starts_with("input_bit_register");
    let upper =
        |name: &String| register(name).is_some_and(|n| n >= if bit(name) { 64 } else { 24 });
    if names.iter().all(upper) {
        "a URCap, another RTDE program, or this program's last connection, which the controller has not \
         dropped yet (it tries again by itself for a moment)"
    } else if names.iter().any(|n| register(n).is_some()) {
        "the lower registers belong to EtherNet/IP, PROFINET and MODBUS as soon as they are enabled; \
         disable them in the installation or use the upper registers"
    } else {
        "another RTDE program or a URCap"
    }
}

impl Recipe {
    /// A recipe as the controller answered it.
    ///
    /// # Errors
    ///
    /// All missing or all foreign variables by name; a wrong number of types; a refusal.
    pub fn granted<S: AsRef<str>>(
        id: u8,
        names: &[S],
        types: &[VariableReply],
    ) -> Result<Self, RecipeError> {
        if names.len() != types.len() {
            return Err(RecipeError::Count { names: names.len(), types: types.len() });
        }
        let named = |reply: VariableReply| -> Vec<String> {
            let all = names.iter().zip(types);
            all.filter(|(_, t)| **t == reply).map(|(n, _)| n.as_ref().to_owned()).collect()
        };
        for (reply, error) in [
            (VariableReply::NotFound, RecipeError::NotFound as fn(_) -> _),
            (VariableReply::InUse, RecipeError::InUse),
        ] {
            let names = named(reply);
            if !names.is_empty() {
                return Err(error(names));
            }
        }
        if id == 0 {
            return Err(RecipeError::Refused { names: names.len() });
        }
        let typed = names.iter().zip(types).filter_map(|(name, reply)| match reply {
            VariableReply::Type(data_type) => Some((name.as_ref(), *data_type)),
            VariableReply::NotFound | VariableReply::InUse => None,
        });
        Ok(Self::new(id, typed))
    }

    /// A recipe of these variables in this order.
    pub fn new<'a>(id: u8, variables: impl IntoIterator<Item = (&'a str, DataType)>) -> Self {
        let mut size = 0;
        let fields = variables
            .into_iter()
            .map(|(name, data_type)| {
                let offset = size;
                size += data_type.size();
                Field { name: name.to_owned(), data_type, offset }
            })
            .collect();
        Self { id, fields, size }
    }

    /// The number that data packets carry.
    pub fn id(&self) -> u8 {
        self.id
    }

    /// Bytes of all values.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The variables in order.
    pub fn fields(&self) -> &[Field] {
        &self.fields
    }

    /// Where a variable is.
    pub fn position(&self, name: &str) -> Option<usize> {
        self.fields.iter().position(|field| field.name == name)
    }

    /// The values of a data packet.
    ///
    /// # Errors
    ///
    /// The packet is longer or shorter than the recipe.
    pub fn values<'a>(
        &'a self,
        values: &'a [u8],
    ) -> Result<impl ExactSizeIterator<Item = Value> + 'a, RecipeError> {
        let record = self.record(values)?;
        Ok((0..self.fields.len()).map(move |n| record.value(n)))
    }

    /// The same for access by position.
    pub fn record<'a>(&'a self, values: &'a [u8]) -> Result<Record<'a>, RecipeError> {
        if values.len() != self.size {
            return Err(RecipeError::Size { got: values.len(), want: self.size });
        }
        Ok(Record { recipe: self, values })
    }
}

/// The values of one data packet.
#[derive(Clone, Copy, Debug)]
pub struct Record<'a> {
    recipe: &'a Recipe,
    values: &'a [u8],
}

impl Record<'_> {
    /// The value of the variable at a position of the recipe.
    ///
    /// # Panics
    ///
    /// If the recipe is shorter.
    pub fn value(&self, position: usize) -> Value {
        let field = &self.recipe.fields[position];
        // The size was checked when the record was made, so that this is never short.
        Value::read(field.data_type, &mut Reader::new(&self.values[field.offset..]))
            .unwrap_or(field.data_type.zero())
    }

    /// The recipe.
    pub fn recipe(&self) -> &Recipe {
        self.recipe
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_missing_variable_is_named() {
        let names = ["timestamp", "ft_raw_wrench", "joint_mode"];
        let types = [
            VariableReply::Type(DataType::Double),
            VariableReply::NotFound,
            VariableReply::NotFound,
        ];
        let error = Recipe::granted(0, &names, &types).unwrap_err();
        assert_eq!(error, RecipeError::NotFound(vec!["ft_raw_wrench".into(), "joint_mode".into()]));
        assert!(error.to_string().contains("ft_raw_wrench, joint_mode"));
    }

    #[test]
    fn the_likely_owner_depends_on_the_register() {
        let owner = |name: &str| RecipeError::InUse(vec![name.into()]).to_string();
        assert!(owner("input_int_register_3").contains("EtherNet/IP"));
        assert!(owner("input_double_register_24").contains("URCap"));
        assert!(owner("input_bit_register_64").contains("URCap"));
        assert!(owner("input_bit_registers0_to_31").contains("another"));
        assert!(owner("speed_slider_mask").contains("another RTDE program"));
    }

    #[test]
    fn a_packet_of_another_size_is_refused() {
        let recipe = Recipe::new(1, [("a", DataType::Bool), ("b", DataType::Vector6d)]);
        for size in (0..100).filter(|n| *n != 49) {
            assert_eq!(
                recipe.record(&vec![0; size]).unwrap_err(),
                RecipeError::Size { got: size, want: 49 }
            );
        }
        assert_eq!(recipe.values(&[1; 49]).unwrap().next(), Some(Value::Bool(true)));
    }
}
