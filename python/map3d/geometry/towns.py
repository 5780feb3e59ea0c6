"""Large towns of all continents, to say where on Earth coordinates are. Written from public facts; positions are within some kilometres."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final


@dataclass(frozen=True)
class Town:
    """Degrees, WGS 84."""

    name: str
    country: str
    lat: float
    lon: float


@lru_cache(maxsize=1)
def towns() -> tuple[Town, ...]:
    found = []
    for line in _TOWNS.strip().splitlines():
        country, _, rest = line.partition(": ")
        for entry in rest.split("; "):
            name, lat, lon = entry.rsplit(" ", 2)
            found.append(Town(name, country, float(lat), float(lon)))
    return tuple(found)


# One country a line: name, latitude, longitude.
_TOWNS: Final = """
Germany: Berlin 52.52 13.40; Hamburg 53.55 9.99; Munich 48.14 11.58; Cologne 50.94 6.96; Frankfurt 50.11 8.68; Stuttgart 48.78 9.18
Germany: Leipzig 51.34 12.37; Dresden 51.05 13.74; Hanover 52.37 9.73; Nuremberg 49.45 11.08; Bremen 53.08 8.80; Dortmund 51.51 7.47
Germany: Freiburg 47.99 7.85; Kassel 51.31 9.49; Erfurt 50.98 11.03; Rostock 54.09 12.14; Kiel 54.32 10.13; Saarbrücken 49.24 6.99
Germany: Augsburg 48.37 10.90; Regensburg 49.01 12.10; Magdeburg 52.13 11.62; Karlsruhe 49.01 8.40; Münster 51.96 7.63; Würzburg 49.79 9.95
Austria: Vienna 48.21 16.37; Graz 47.07 15.44; Linz 48.31 14.29; Salzburg 47.80 13.04; Innsbruck 47.27 11.39; Klagenfurt 46.62 14.31
Switzerland: Zürich 47.37 8.54; Geneva 46.20 6.14; Basel 47.56 7.59; Bern 46.95 7.45; Lausanne 46.52 6.63; Lugano 46.00 8.95
France: Paris 48.86 2.35; Lyon 45.76 4.84; Marseille 43.30 5.37; Toulouse 43.60 1.44; Nice 43.70 7.27; Nantes 47.22 -1.55
France: Strasbourg 48.57 7.75; Bordeaux 44.84 -0.58; Lille 50.63 3.06; Rennes 48.11 -1.68; Montpellier 43.61 3.88; Dijon 47.32 5.04
France: Grenoble 45.19 5.72; Clermont-Ferrand 45.78 3.09; Tours 47.39 0.69; Brest 48.39 -4.49; Limoges 45.83 1.26; Reims 49.26 4.03
France: Rouen 49.44 1.10; Ajaccio 41.93 8.74; Saint-Denis (Réunion) -20.88 55.45; Cayenne 4.94 -52.33; Pointe-à-Pitre 16.24 -61.53
Netherlands: Amsterdam 52.37 4.90; Rotterdam 51.92 4.48; The Hague 52.08 4.31; Utrecht 52.09 5.12; Eindhoven 51.44 5.47; Groningen 53.22 6.57
Belgium: Brussels 50.85 4.35; Antwerp 51.22 4.40; Ghent 51.05 3.72; Liège 50.63 5.57
Luxembourg: Luxembourg 49.61 6.13
United Kingdom: London 51.51 -0.13; Birmingham 52.48 -1.90; Manchester 53.48 -2.24; Glasgow 55.86 -4.25; Edinburgh 55.95 -3.19
United Kingdom: Bristol 51.45 -2.59; Leeds 53.80 -1.55; Newcastle 54.98 -1.61; Cardiff 51.48 -3.18; Belfast 54.60 -5.93; Norwich 52.63 1.30
United Kingdom: Plymouth 50.37 -4.14; Southampton 50.90 -1.40; Aberdeen 57.15 -2.09; Inverness 57.48 -4.22
Ireland: Dublin 53.35 -6.26; Cork 51.90 -8.47; Galway 53.27 -9.05
Spain: Madrid 40.42 -3.70; Barcelona 41.39 2.17; Valencia 39.47 -0.38; Seville 37.39 -5.98; Zaragoza 41.65 -0.88; Málaga 36.72 -4.42
Spain: Bilbao 43.26 -2.93; Palma 39.57 2.65; Las Palmas 28.12 -15.43; Murcia 37.99 -1.13; Valladolid 41.65 -4.72; A Coruña 43.36 -8.41
Portugal: Lisbon 38.72 -9.14; Porto 41.15 -8.61; Faro 37.02 -7.93; Funchal 32.65 -16.91; Ponta Delgada 37.74 -25.67
Italy: Rome 41.90 12.50; Milan 45.46 9.19; Naples 40.85 14.27; Turin 45.07 7.69; Palermo 38.12 13.36; Bologna 44.49 11.34
Italy: Florence 43.77 11.25; Bari 41.12 16.87; Venice 45.44 12.32; Trento 46.07 11.12; Cagliari 39.22 9.12; Catania 37.50 15.09
Italy: Genoa 44.41 8.93; Trieste 45.65 13.78; Ancona 43.62 13.52; Reggio Calabria 38.11 15.65
Malta: Valletta 35.90 14.51
Denmark: Copenhagen 55.68 12.57; Aarhus 56.16 10.20; Odense 55.40 10.39; Aalborg 57.05 9.92
Sweden: Stockholm 59.33 18.07; Gothenburg 57.71 11.97; Malmö 55.60 13.00; Umeå 63.83 20.26; Östersund 63.18 14.64; Luleå 65.58 22.15
Norway: Oslo 59.91 10.75; Bergen 60.39 5.32; Trondheim 63.43 10.40; Stavanger 58.97 5.73; Tromsø 69.65 18.96; Bodø 67.28 14.40
Finland: Helsinki 60.17 24.94; Tampere 61.50 23.76; Turku 60.45 22.27; Oulu 65.01 25.47; Kuopio 62.89 27.68; Rovaniemi 66.50 25.73
Iceland: Reykjavik 64.15 -21.94; Akureyri 65.68 -18.09
Greenland: Nuuk 64.18 -51.72
Estonia: Tallinn 59.44 24.75; Tartu 58.38 26.72
Latvia: Riga 56.95 24.11
Lithuania: Vilnius 54.69 25.28; Kaunas 54.90 23.89
Poland: Warsaw 52.23 21.01; Kraków 50.06 19.94; Wrocław 51.11 17.04; Poznań 52.41 16.93; Gdańsk 54.35 18.65; Łódź 51.76 19.46
Poland: Szczecin 53.43 14.55; Lublin 51.25 22.57; Białystok 53.13 23.16; Katowice 50.26 19.02; Rzeszów 50.04 22.00
Czechia: Prague 50.08 14.44; Brno 49.20 16.61; Ostrava 49.82 18.26; Plzeň 49.74 13.38
Slovakia: Bratislava 48.15 17.11; Košice 48.72 21.26; Žilina 49.22 18.74
Hungary: Budapest 47.50 19.04; Debrecen 47.53 21.62; Szeged 46.25 20.15; Pécs 46.07 18.23
Slovenia: Ljubljana 46.06 14.51; Maribor 46.55 15.65
Croatia: Zagreb 45.81 15.98; Split 43.51 16.44; Osijek 45.55 18.69; Rijeka 45.33 14.44
Bosnia and Herzegovina: Sarajevo 43.86 18.41
Serbia: Belgrade 44.79 20.45; Niš 43.32 21.90; Novi Sad 45.27 19.83
Montenegro: Podgorica 42.44 19.26
Albania: Tirana 41.33 19.82
North Macedonia: Skopje 42.00 21.43
Greece: Athens 37.98 23.73; Thessaloniki 40.64 22.94; Heraklion 35.34 25.14; Ioannina 39.66 20.85
Bulgaria: Sofia 42.70 23.32; Plovdiv 42.14 24.75; Varna 43.21 27.91
Romania: Bucharest 44.43 26.10; Cluj-Napoca 46.77 23.59; Timișoara 45.75 21.23; Iași 47.16 27.58; Constanța 44.18 28.65
Moldova: Chișinău 47.01 28.86
Ukraine: Kyiv 50.45 30.52; Kharkiv 49.99 36.23; Odesa 46.48 30.72; Lviv 49.84 24.03; Dnipro 48.46 35.05; Donetsk 48.02 37.80
Belarus: Minsk 53.90 27.57; Brest 52.10 23.70; Homel 52.44 31.00
Russia: Moscow 55.76 37.62; Saint Petersburg 59.94 30.31; Kazan 55.79 49.12; Nizhny Novgorod 56.33 44.00; Samara 53.20 50.15
Russia: Rostov-on-Don 47.24 39.71; Volgograd 48.71 44.51; Murmansk 68.97 33.08; Yekaterinburg 56.84 60.61; Perm 58.01 56.25
Russia: Novosibirsk 55.03 82.92; Omsk 54.99 73.37; Krasnoyarsk 56.01 92.87; Irkutsk 52.29 104.30; Yakutsk 62.03 129.73
Russia: Vladivostok 43.12 131.89; Khabarovsk 48.48 135.08; Arkhangelsk 64.54 40.54; Kaliningrad 54.71 20.51; Magadan 59.56 150.80
Turkey: Istanbul 41.01 28.98; Ankara 39.93 32.86; İzmir 38.42 27.14; Antalya 36.90 30.70; Adana 37.00 35.32; Diyarbakır 37.91 40.24
Turkey: Trabzon 41.00 39.72
Cyprus: Nicosia 35.19 33.38
Georgia: Tbilisi 41.72 44.79
Armenia: Yerevan 40.18 44.51
Azerbaijan: Baku 40.41 49.87
Syria: Damascus 33.51 36.29; Aleppo 36.20 37.16
Lebanon: Beirut 33.89 35.50
Israel: Jerusalem 31.77 35.21; Tel Aviv 32.08 34.78
Jordan: Amman 31.95 35.93
Iraq: Baghdad 33.31 44.37; Mosul 36.34 43.13; Basra 30.51 47.81
Iran: Tehran 35.69 51.39; Mashhad 36.30 59.61; Isfahan 32.65 51.67; Shiraz 29.59 52.58; Tabriz 38.08 46.29; Kerman 30.28 57.08
Kuwait: Kuwait City 29.38 47.98
Saudi Arabia: Riyadh 24.71 46.68; Jeddah 21.49 39.19; Dammam 26.43 50.10; Medina 24.47 39.61; Abha 18.22 42.50; Tabuk 28.38 36.57
Saudi Arabia: Hail 27.52 41.69; Najran 17.49 44.13
Bahrain: Manama 26.23 50.59
Qatar: Doha 25.29 51.53
United Arab Emirates: Dubai 25.20 55.27; Abu Dhabi 24.45 54.38
Oman: Muscat 23.59 58.41; Salalah 17.02 54.09; Duqm 19.67 57.70
Yemen: Sanaa 15.37 44.19; Aden 12.79 45.02; Mukalla 14.54 49.12; Seiyun 15.94 48.79; Al Ghaydah 16.21 52.18; Hodeidah 14.80 42.95
Yemen: Hadibo (Socotra) 12.65 54.02
Egypt: Cairo 30.04 31.24; Alexandria 31.20 29.92; Luxor 25.69 32.64; Aswan 24.09 32.90
Libya: Tripoli 32.89 13.19; Benghazi 32.12 20.09; Sabha 27.04 14.43
Tunisia: Tunis 36.81 10.18; Sfax 34.74 10.76
Algeria: Algiers 36.75 3.06; Oran 35.70 -0.63; Constantine 36.37 6.61; Tamanrasset 22.79 5.53; Ouargla 31.95 5.33
Morocco: Casablanca 33.57 -7.59; Rabat 34.02 -6.83; Marrakesh 31.63 -8.01; Fez 34.03 -5.00; Tangier 35.77 -5.80; Agadir 30.43 -9.60
Mauritania: Nouakchott 18.08 -15.98
Senegal: Dakar 14.72 -17.47
Gambia: Banjul 13.45 -16.58
Guinea: Conakry 9.64 -13.58
Sierra Leone: Freetown 8.48 -13.23
Liberia: Monrovia 6.30 -10.80
Ivory Coast: Abidjan 5.36 -4.01; Bouaké 7.69 -5.03
Mali: Bamako 12.64 -8.00; Gao 16.27 -0.05
Burkina Faso: Ouagadougou 12.37 -1.52
Ghana: Accra 5.60 -0.19; Kumasi 6.69 -1.62
Togo: Lomé 6.13 1.22
Benin: Cotonou 6.37 2.39
Niger: Niamey 13.51 2.11; Agadez 16.97 7.99
Nigeria: Lagos 6.52 3.38; Abuja 9.06 7.50; Kano 12.00 8.52; Port Harcourt 4.82 7.05; Maiduguri 11.85 13.16
Chad: N'Djamena 12.13 15.06
Sudan: Khartoum 15.50 32.56; Port Sudan 19.62 37.22; El Obeid 13.18 30.22
South Sudan: Juba 4.85 31.58
Eritrea: Asmara 15.34 38.93; Assab 13.01 42.74
Djibouti: Djibouti 11.59 43.15
Ethiopia: Addis Ababa 9.03 38.74; Dire Dawa 9.60 41.85; Mekelle 13.50 39.47; Jijiga 9.35 42.80; Gode 5.95 43.55
Somalia: Mogadishu 2.05 45.32; Hargeisa 9.56 44.06; Berbera 10.44 45.01; Bosaso 11.28 49.18; Garowe 8.41 48.48; Galkayo 6.77 47.43
Somalia: Kismayo -0.36 42.55; Brava 1.11 44.03; Baidoa 3.11 43.65; Beledweyne 4.74 45.20; Hobyo 5.35 48.53; Hafun 10.42 51.27
Kenya: Nairobi -1.29 36.82; Mombasa -4.04 39.67; Kisumu -0.09 34.77; Garissa -0.45 39.65
Uganda: Kampala 0.35 32.58
Rwanda: Kigali -1.94 30.06
Tanzania: Dar es Salaam -6.79 39.21; Dodoma -6.16 35.75; Mwanza -2.52 32.90
Democratic Republic of the Congo: Kinshasa -4.44 15.27; Lubumbashi -11.66 27.48; Kisangani 0.52 25.19; Goma -1.68 29.22
Congo: Brazzaville -4.26 15.24
Gabon: Libreville 0.42 9.47
Cameroon: Yaoundé 3.85 11.50; Douala 4.05 9.77
Central African Republic: Bangui 4.39 18.56
Angola: Luanda -8.84 13.29; Huambo -12.78 15.74
Zambia: Lusaka -15.39 28.32
Malawi: Lilongwe -13.96 33.77
Mozambique: Maputo -25.97 32.57; Beira -19.84 34.84; Nampula -15.12 39.27
Zimbabwe: Harare -17.83 31.05; Bulawayo -20.15 28.58
Botswana: Gaborone -24.63 25.92
Namibia: Windhoek -22.56 17.08
South Africa: Johannesburg -26.20 28.05; Cape Town -33.92 18.42; Durban -29.86 31.02; Port Elizabeth -33.96 25.60; Bloemfontein -29.12 26.21
Madagascar: Antananarivo -18.88 47.51; Toliara -23.35 43.67; Mahajanga -15.72 46.32; Antsiranana -12.28 49.29
Comoros: Moroni -11.70 43.26
Mauritius: Port Louis -20.16 57.50
Seychelles: Victoria -4.62 55.45
Maldives: Malé 4.18 73.51
Kazakhstan: Almaty 43.24 76.89; Astana 51.17 71.45; Aktau 43.65 51.16; Atyrau 47.10 51.92; Karaganda 49.80 73.10
Uzbekistan: Tashkent 41.30 69.24; Samarkand 39.65 66.96; Nukus 42.46 59.62
Turkmenistan: Ashgabat 37.96 58.33
Kyrgyzstan: Bishkek 42.87 74.57
Tajikistan: Dushanbe 38.56 68.79
Afghanistan: Kabul 34.53 69.17; Herat 34.35 62.20; Kandahar 31.61 65.71
Pakistan: Karachi 24.86 67.01; Lahore 31.55 74.34; Islamabad 33.69 73.05; Quetta 30.18 67.00; Gwadar 25.13 62.32
India: Delhi 28.61 77.21; Mumbai 19.08 72.88; Bengaluru 12.97 77.59; Chennai 13.08 80.27; Kolkata 22.57 88.36; Hyderabad 17.39 78.49
India: Ahmedabad 23.02 72.57; Jaipur 26.91 75.79; Lucknow 26.85 80.95; Nagpur 21.15 79.09; Kochi 9.93 76.27; Guwahati 26.14 91.74
India: Visakhapatnam 17.69 83.22; Bhopal 23.26 77.41; Port Blair 11.62 92.73
Sri Lanka: Colombo 6.93 79.86
Nepal: Kathmandu 27.72 85.32
Bangladesh: Dhaka 23.81 90.41; Chittagong 22.36 91.78
Myanmar: Yangon 16.87 96.20; Mandalay 21.96 96.09
Thailand: Bangkok 13.76 100.50; Chiang Mai 18.79 98.98; Phuket 7.88 98.39
Laos: Vientiane 17.98 102.63
Cambodia: Phnom Penh 11.56 104.92
Vietnam: Hanoi 21.03 105.85; Ho Chi Minh City 10.82 106.63; Da Nang 16.05 108.20
Malaysia: Kuala Lumpur 3.14 101.69; Kuching 1.55 110.34; Kota Kinabalu 5.98 116.07
Singapore: Singapore 1.35 103.82
Indonesia: Jakarta -6.21 106.85; Surabaya -7.26 112.75; Medan 3.60 98.67; Makassar -5.15 119.43; Balikpapan -1.27 116.83; Jayapura -2.53 140.72
Philippines: Manila 14.60 120.98; Cebu 10.32 123.89; Davao 7.19 125.46
China: Beijing 39.90 116.41; Shanghai 31.23 121.47; Guangzhou 23.13 113.26; Shenzhen 22.54 114.06; Chengdu 30.57 104.07; Wuhan 30.59 114.31
China: Xi'an 34.34 108.94; Chongqing 29.56 106.55; Harbin 45.80 126.53; Shenyang 41.80 123.43; Kunming 25.04 102.72; Ürümqi 43.83 87.62
China: Lanzhou 36.06 103.83; Lhasa 29.65 91.14; Qingdao 36.07 120.38; Nanjing 32.06 118.80; Kashgar 39.47 75.99
Hong Kong: Hong Kong 22.32 114.17
Taiwan: Taipei 25.03 121.57; Kaohsiung 22.62 120.31
Mongolia: Ulaanbaatar 47.89 106.91
North Korea: Pyongyang 39.04 125.76
South Korea: Seoul 37.57 126.98; Busan 35.18 129.08; Gwangju 35.16 126.85
Japan: Tokyo 35.68 139.69; Osaka 34.69 135.50; Nagoya 35.18 136.91; Sapporo 43.06 141.35; Fukuoka 33.59 130.40; Sendai 38.27 140.87
Japan: Hiroshima 34.39 132.46; Niigata 37.92 139.04; Kagoshima 31.60 130.56; Naha 26.21 127.68; Kanazawa 36.56 136.66
Australia: Sydney -33.87 151.21; Melbourne -37.81 144.96; Brisbane -27.47 153.03; Perth -31.95 115.86; Adelaide -34.93 138.60
Australia: Darwin -12.46 130.84; Hobart -42.88 147.33; Canberra -35.28 149.13; Cairns -16.92 145.77; Alice Springs -23.70 133.88
New Zealand: Auckland -36.85 174.76; Wellington -41.29 174.78; Christchurch -43.53 172.64; Dunedin -45.87 170.50
Papua New Guinea: Port Moresby -9.44 147.18
New Caledonia: Nouméa -22.27 166.46
Fiji: Suva -18.14 178.44
Samoa: Apia -13.83 -171.77
French Polynesia: Papeete -17.54 -149.57
United States: New York 40.71 -74.01; Los Angeles 34.05 -118.24; Chicago 41.88 -87.63; Houston 29.76 -95.37; Phoenix 33.45 -112.07
United States: Philadelphia 39.95 -75.17; Dallas 32.78 -96.80; San Francisco 37.77 -122.42; Seattle 47.61 -122.33; Denver 39.74 -104.99
United States: Washington 38.91 -77.04; Boston 42.36 -71.06; Miami 25.76 -80.19; Atlanta 33.75 -84.39; Minneapolis 44.98 -93.27
United States: Detroit 42.33 -83.05; New Orleans 29.95 -90.07; Salt Lake City 40.76 -111.89; Portland 45.52 -122.68; Kansas City 39.10 -94.58
United States: Anchorage 61.22 -149.90; Honolulu 21.31 -157.86; Albuquerque 35.08 -106.65; Fargo 46.88 -96.79; Billings 45.78 -108.50
United States: Boise 43.62 -116.20; Nashville 36.16 -86.78; Charlotte 35.23 -80.84; Buffalo 42.89 -78.88; Fairbanks 64.84 -147.72
Puerto Rico: San Juan 18.47 -66.11
Canada: Toronto 43.65 -79.38; Montreal 45.50 -73.57; Vancouver 49.28 -123.12; Calgary 51.05 -114.07; Ottawa 45.42 -75.70
Canada: Winnipeg 49.90 -97.14; Québec 46.81 -71.21; Halifax 44.65 -63.58; Edmonton 53.55 -113.49; St. John's 47.56 -52.71; Whitehorse 60.72 -135.06
Canada: Yellowknife 62.45 -114.37; Iqaluit 63.75 -68.52; Thunder Bay 48.38 -89.25
Mexico: Mexico City 19.43 -99.13; Guadalajara 20.67 -103.35; Monterrey 25.69 -100.32; Tijuana 32.51 -117.04; Mérida 20.97 -89.62
Cuba: Havana 23.11 -82.37; Santiago de Cuba 20.02 -75.82
Jamaica: Kingston 17.97 -76.79
Haiti: Port-au-Prince 18.54 -72.34
Dominican Republic: Santo Domingo 18.49 -69.93
Trinidad and Tobago: Port of Spain 10.66 -61.51
Guatemala: Guatemala City 14.63 -90.51
Honduras: Tegucigalpa 14.07 -87.19
Nicaragua: Managua 12.11 -86.24
Costa Rica: San José 9.93 -84.08
Panama: Panama City 8.98 -79.52
Colombia: Bogotá 4.71 -74.07; Medellín 6.24 -75.58; Cali 3.45 -76.53; Barranquilla 10.97 -74.80
Venezuela: Caracas 10.48 -66.90; Maracaibo 10.65 -71.64; Ciudad Guayana 8.35 -62.64
Guyana: Georgetown 6.80 -58.16
Suriname: Paramaribo 5.85 -55.20
Ecuador: Quito -0.18 -78.47; Guayaquil -2.19 -79.89
Peru: Lima -12.05 -77.04; Arequipa -16.41 -71.54; Cusco -13.53 -71.97; Iquitos -3.75 -73.25
Bolivia: La Paz -16.49 -68.12; Santa Cruz -17.78 -63.18
Brazil: São Paulo -23.55 -46.63; Rio de Janeiro -22.91 -43.17; Brasília -15.79 -47.88; Salvador -12.97 -38.50; Fortaleza -3.73 -38.53
Brazil: Belo Horizonte -19.92 -43.94; Manaus -3.12 -60.02; Recife -8.05 -34.88; Porto Alegre -30.03 -51.23; Belém -1.46 -48.50
Brazil: Cuiabá -15.60 -56.10; Curitiba -25.43 -49.27; Porto Velho -8.76 -63.90
Paraguay: Asunción -25.26 -57.58
Uruguay: Montevideo -34.90 -56.16
Argentina: Buenos Aires -34.60 -58.38; Córdoba -31.42 -64.18; Mendoza -32.89 -68.84; Salta -24.79 -65.41; Bahía Blanca -38.72 -62.27
Argentina: Comodoro Rivadavia -45.86 -67.48; Ushuaia -54.80 -68.30
Chile: Santiago -33.45 -70.67; Antofagasta -23.65 -70.40; Concepción -36.83 -73.05; Punta Arenas -53.16 -70.91
"""
