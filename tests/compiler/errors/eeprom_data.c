// dialect: xc8
#include <xc.h>
__EEPROM_DATA(1, 2, 3, 4, 5, 6, 7, 0);
// error: __EEPROM_DATA takes 8 values, not 3
// hint: fill the rest with 0
__EEPROM_DATA(1, 2, 0);
// error: __EEPROM_DATA takes 8 values, not 9
__EEPROM_DATA(1, 2, 3, 4, 5, 6, 7, 8, 9);
void main(void) { }
